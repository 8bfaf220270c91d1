# SPDX-License-Identifier: GPL-3.0-or-later
"""How many small mistakes in the code that decides would be noticed by its own tests. By mutmut.

    python tests/tools/mutation.py [PART OF A FILE'S PATH ...]

Each file is changed in hundreds of ways, one at a time, in a copy of the collection in .cache/mutation, and the tests
at its mirrored path are run. What they do not notice is listed with its change; the exit status is 1 below LEAST.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections import Counter
from pathlib import Path

CHECKOUT = Path(__file__).resolve().parents[2]
WORK = CHECKOUT / ".cache" / "mutation"
# mutmut names code by its path: this one has to be the name that it is imported by
PLACE = Path("ansible_collections/rosops/fleet")
MUTMUT = str(Path(sys.executable).parent / "mutmut")
LEAST = 0.85
FILES = (
    "module_utils/_ros/gate.py",
    "module_utils/_ros/checks.py",
    "module_utils/_ros/contract.py",
    "module_utils/_ros/conditions.py",
    "module_utils/_ros/messages.py",
    "module_utils/_step/record.py",
    "plugin_utils/_kube/verdicts.py",
    "plugin_utils/_update/*.py",
)
TYPES = ("world.py",)  # nothing is decided there
BESIDE = {  # file -> other files of its room whose tests are its own, too
    "app_change": ["engine_soak"],
    "change": ["host_change", "app_change_install", "app_change"],
    "checks": ["gate"],
    "hands": ["app_change_install", "app_change"],
    "manifests": ["step", "app_change"],
    "nodes": ["step"],
    "revisions": ["plan"],
}


def files(words: list[str]) -> list[str]:
    """Paths below plugins, those that have one of the words in them if there are words."""
    plugins = CHECKOUT / "plugins"
    there = [path for pattern in FILES for path in sorted(plugins.glob(pattern)) if path.name not in TYPES]
    found = [str(path.relative_to(plugins)) for path in there]
    return [name for name in found if not words or any(word in name for word in words)]


def tests(name: str) -> list[str]:
    """Test files of a file, as paths from the collection: test_<file>.py, test_<file>_<what>.py."""
    path = Path(name)
    names = [path.stem, f"{path.stem}_*", *BESIDE.get(path.stem, ())]
    room = CHECKOUT / "tests" / "unit" / "plugins" / path.parent
    return [str(one.relative_to(CHECKOUT)) for name in names for one in sorted(room.glob(f"test_{name}.py"))]


def config(name: str) -> str:
    """mutmut's settings for one file."""
    selection = "\n    ".join(str(PLACE / one) for one in tests(name))
    return (
        f"[mutmut]\nsource_paths={PLACE}/plugins\nonly_mutate={PLACE}/plugins/{name}\nalso_copy=ansible_collections\n"
        f"pytest_add_cli_args_test_selection={selection}\n"
        "pytest_add_cli_args=--import-mode=importlib\n    -p\n    no:cacheprovider\n"
    )


def mutate(name: str) -> dict[str, str]:
    """Mutant -> killed, survived, timeout, ...; all the work is done here."""
    shutil.rmtree(WORK, ignore_errors=True)
    for part in ("plugins", "roles", "playbooks", "tests/unit", "tests/tools", "tests/lab", "tests/apps"):
        shutil.copytree(CHECKOUT / part, WORK / PLACE / part, symlinks=True)
    (WORK / "setup.cfg").write_text(config(name), "utf-8")
    done = _mutmut("run", "--max-children", os.environ.get("MUTATION_CHILDREN", "1"))
    lines = _mutmut("results", "--all", "true").splitlines()
    listed = [(mutant.strip(), verdict) for mutant, colon, verdict in (line.partition(": ") for line in lines) if colon]
    if not listed:
        raise SystemExit(f"{name}: mutmut has no results:\n{done[-3000:]}")
    return dict(listed)


def _mutmut(*words: str) -> str:
    done = subprocess.run(  # noqa: S603
        ["nice", "-n", "19", MUTMUT, *words],  # noqa: S607
        cwd=WORK,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    return done.stdout


def change(mutant: str) -> str:
    """The lines that a mutant changes."""
    lines = _mutmut("show", mutant).splitlines()
    return "\n".join(f"    {line}" for line in lines if line[:1] in "+-" and line[:3] not in ("+++", "---"))


def main(words: list[str]) -> int:
    """Print what is found, file by file."""
    worst = 1.0
    for name in files(words):
        if not tests(name):
            print(f"{name}: no tests at its mirrored path")
            worst = 0.0
            continue
        results = mutate(name)
        noticed = [mutant for mutant, verdict in results.items() if verdict not in ("survived", "no tests")]
        share = len(noticed) / len(results)
        worst = min(worst, share)
        counts = ", ".join(f"{count} {verdict}" for verdict, count in sorted(Counter(results.values()).items()))
        print(f"{name}: {share:.1%} of {len(results)} noticed ({counts})", flush=True)
        for mutant in sorted(results.keys() - set(noticed)):
            print(f"  {mutant.rpartition('.')[2]}: {results[mutant]}\n{change(mutant)}", flush=True)
    return 0 if worst >= LEAST else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
