# SPDX-License-Identifier: GPL-3.0-or-later
"""What `make check` looks at: the files that differ from the main branch, and the unit tests that are near them.

    python tests/tools/affected.py tests     unit tests, the nearest first
    python tests/tools/affected.py yaml      changed YAML files

A test is near a Python file that it imports itself or with one file between them (the nearest ones there are, where no
test is that near), and near any other file when it has the name of the file or of one of its directories as a text.
What is further off is `make test-unit`'s.
"""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path, PurePosixPath

from imports import imported

CHECKOUT = Path(__file__).resolve().parents[2]
UNIT = "tests/unit/"
ALWAYS = "tests/unit/test_rooms.py"
NEAR = 2
# Where else than in the checkout and beside the file itself an import may begin.
ROOTS = ("tests/tools", "tools", "tests/lab", "tests/apps", "benchmarks")
GENERAL = {"tests", "unit", "plugins", "tasks", "defaults", "meta", "files", "main.yml"}


def near(changed: Iterable[str], files: Mapping[str, str]) -> list[str]:
    """Unit tests that are near changed files, by distance; `files` is path -> text of all Python files.

    A test that was changed is at distance 0.
    """
    graph = {name: set(needs(PurePosixPath(name), text, files)) for name, text in files.items()}
    changed = list(changed)
    distance = {name: 0 for name in changed if name in files}
    for name in changed:
        if name not in files:
            words = set(PurePosixPath(name).parts) - GENERAL
            distance |= {test: 1 for test, text in files.items() if _is_unit(test) and words & _texts(text)}
    step = 0
    while reached := {name for name, far in distance.items() if far == step}:
        if step >= NEAR and any(map(_is_test, distance)):
            break
        step += 1
        distance |= {name: step for name, below in graph.items() if name not in distance and below & reached}
    tests = [name for name in distance if _is_test(name)]
    return sorted(tests, key=lambda name: (distance[name], name))


def _is_unit(name: str) -> bool:
    return name.startswith(UNIT)


def _is_test(name: str) -> bool:
    return _is_unit(name) and PurePosixPath(name).name.startswith("test_")


def needs(file: PurePosixPath, text: str, files: Mapping[str, str]) -> Iterator[str]:
    """Files that a file imports, and the conftest.py of its directories."""
    for name in imported(file, text):
        for start in ("", f"{file.parent}/", *(f"{root}/" for root in ROOTS)):
            path = start + name.replace(".", "/")
            if found := next((one for one in (f"{path}.py", f"{path.rpartition('/')[0]}.py") if one in files), None):
                yield found
                break
    if _is_test(str(file)):
        yield from (name for one in file.parents if (name := f"{one}/conftest.py") in files)


def _texts(text: str) -> set[str]:
    """The words of a file's string constants, split where paths are."""
    constants = (item.value for item in ast.walk(ast.parse(text)) if isinstance(item, ast.Constant))
    return {part for value in constants if isinstance(value, str) and len(value) < 200 for part in value.split("/")}


def changed_files() -> list[str]:
    """Committed since main (or since the last commit, on main itself), not committed, and not yet known to git."""
    head, main = _git("rev-parse", "HEAD"), _git("rev-parse", "--verify", "--quiet", "origin/main")
    base = _git("merge-base", "HEAD", main[0]) if main else []
    if not base or base == head:
        base = _git("rev-parse", "--verify", "--quiet", "HEAD~1")
    since = _git("diff", "--name-only", "--diff-filter=d", *base)
    return sorted({*since, *_git("ls-files", "--others", "--exclude-standard")})


def _git(*words: str) -> list[str]:
    command = ["git", "-c", f"safe.directory={CHECKOUT}", *words]
    return subprocess.run(command, cwd=CHECKOUT, capture_output=True, text=True, check=False).stdout.splitlines()  # noqa: S603


def main(word: str) -> int:
    """Print the names, in one line each."""
    changed = changed_files()
    if word == "yaml":
        print("\n".join(name for name in changed if name.endswith((".yml", ".yaml"))))
        return 0
    listed = [name for name in _git("ls-files", "--cached", "--others", "--exclude-standard") if name.endswith(".py")]
    files = {name: path.read_text("utf-8") for name in listed if (path := CHECKOUT / name).exists()}
    print("\n".join(dict.fromkeys([*near(changed, files), ALWAYS])))
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
