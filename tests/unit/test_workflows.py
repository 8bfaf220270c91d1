# SPDX-License-Identifier: GPL-3.0-or-later
"""What GitHub runs: targets that the Makefile has, actions that nobody can exchange, and every supported ansible-core.

That the files are workflows at all is checked by `make lint-workflows`.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

CHECKOUT = Path(__file__).resolve().parents[2]
WORKFLOWS = sorted((CHECKOUT / ".github" / "workflows").glob("*.yml"))
ACTION = CHECKOUT / ".github" / "actions" / "make" / "action.yml"
MAKEFILE = (CHECKOUT / "Makefile").read_text("utf-8")
TARGETS = set(re.findall(r"^([\w-]+):", MAKEFILE, re.MULTILINE))
PINNED = re.compile(r"[\w-]+/[\w-]+@[0-9a-f]{40}")


def jobs() -> Iterator[tuple[str, dict[str, Any]]]:
    for path in WORKFLOWS:
        for name, job in yaml.safe_load(path.read_text("utf-8"))["jobs"].items():
            yield f"{path.stem}.{name}", job


def targets(job: dict[str, Any]) -> set[str]:
    """What the job makes; a matrix's name stands for all its values."""
    named: set[str] = set()
    for step in job["steps"]:
        for word in step.get("with", {}).get("target", "").replace("${{ ", "${{").replace(" }}", "}}").split():
            variable = re.fullmatch(r"\$\{\{matrix\.(\w+)\}\}", word)
            named |= set(job["strategy"]["matrix"][variable[1]]) if variable else {word}
    return named


@pytest.mark.parametrize(("name", "job"), [pytest.param(*pair, id=pair[0]) for pair in jobs()])
def test_each_target_is_one_of_the_makefiles(name: str, job: dict[str, Any]) -> None:
    assert targets(job), f"{name} makes nothing"
    assert targets(job) <= TARGETS


def test_together_they_run_all_that_make_test_does() -> None:
    [hostless] = re.findall(r"^HOSTLESS := (.*)$", MAKEFILE, re.MULTILINE)
    [first_lane] = re.findall(r"--lane (artifacts .*) \\$", MAKEFILE[MAKEFILE.index("\ntest:") :], re.MULTILINE)[:1]
    run = set().union(*(targets(job) for name, job in jobs() if name.startswith("ci.")))
    assert {*hostless.split(), *first_lane.split()} - {"artifacts"} <= run


@pytest.mark.parametrize("path", [*WORKFLOWS, ACTION], ids=lambda path: path.stem)
def test_actions_of_others_are_pinned_by_commit(path: Path) -> None:
    used = re.findall(r"uses: (\S+)", path.read_text("utf-8"))
    assert used
    assert not [one for one in used if one != "./.github/actions/make" and not PINNED.fullmatch(one)]


def test_the_matrix_has_the_ansible_cores_that_make_knows() -> None:
    [others] = re.findall(r"^CORES := (.*)$", MAKEFILE, re.MULTILINE)
    files = (CHECKOUT / "tests" / "environments").glob("core-*.txt")
    [own] = re.findall(r"^ansible-core==(\d+\.\d+)\.", (CHECKOUT / "requirements.txt").read_text("utf-8"), re.MULTILINE)
    matrix = dict(jobs())["ci.ansible-test"]["strategy"]["matrix"]["include"]
    assert {one["core"] for one in matrix} == {own, *others.split()}
    assert set(others.split()) == {path.stem.removeprefix("core-") for path in files}
    assert yaml.safe_load((CHECKOUT / "meta" / "runtime.yml").read_text("utf-8"))["requires_ansible"] == f">={own}.0"
