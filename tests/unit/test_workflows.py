# SPDX-License-Identifier: GPL-3.0-or-later
"""What GitHub runs: targets that the Makefile has, actions that nobody can exchange, and every supported ansible-core.

That the files are workflows at all is checked by `make lint-workflows`.
"""

from __future__ import annotations

import re
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

CHECKOUT = Path(__file__).resolve().parents[2]
WORKFLOWS = sorted((CHECKOUT / ".github" / "workflows").glob("*.yml"))
OF_A_FLEET = CHECKOUT / "playbooks" / "files" / "repository" / "dot-github" / "workflows" / "fleet.yml"
OF_GITLAB = OF_A_FLEET.parents[2] / "dot-gitlab-ci.yml"
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


@pytest.mark.parametrize("path", [*WORKFLOWS, ACTION, OF_A_FLEET], ids=lambda path: path.stem)
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


# --- what a fleet's own repository gets -------------------------------------------------------------------------------


def test_who_sends_a_change_is_not_root_on_a_runner_of_the_fleet() -> None:
    """What runs there is merged, and comes from the runner's own checkout: no name that somebody else may have."""
    fleet = yaml.safe_load(OF_A_FLEET.read_text("utf-8"))
    assert fleet["permissions"] == {"contents": "read"}
    own = {name: job for name, job in fleet["jobs"].items() if "self-hosted" in job["runs-on"]}
    assert {name: job.get("if") for name, job in own.items()} == {"update": "github.event_name == 'push'"}
    assert fleet["on"]["push"] == {"branches": ["main"]}
    gitlab = yaml.safe_load(OF_GITLAB.read_text("utf-8"))["update"]
    assert gitlab["rules"] == [{"if": '$CI_PIPELINE_SOURCE == "push" && $CI_COMMIT_BRANCH == $CI_DEFAULT_BRANCH'}]
    commands = [step.get("run", "") for step in own["update"]["steps"]] + gitlab["script"]
    assert [one for one in commands if "requirements.yml" in one or "git+" in one] == []
    assert len([one for one in commands if 'collection install "$ROSOPS_FLEET"' in one]) == 2


def test_no_checkout_leaves_its_token_for_what_it_runs() -> None:
    steps = [one for job in yaml.safe_load(OF_A_FLEET.read_text("utf-8"))["jobs"].values() for one in job["steps"]]
    checkouts = [one["with"] for one in steps if one.get("uses", "").startswith("actions/checkout@")]
    assert checkouts == [{"persist-credentials": False}] * 2


@pytest.mark.parametrize(
    ("vaults", "status"),
    [
        ({}, 0),
        ({"inventory/vault.yml": "$ANSIBLE_VAULT;1.1;AES256\n6162\n"}, 0),
        ({"inventory/vault.yml": "vault_password: hush\n"}, 1),
        ({"inventory/a/vault.yml": "$ANSIBLE_VAULT;1.1;AES256\n", "inventory/b/vault.yml": "x: y\n"}, 1),
        ({".venv/vault.yml": "x: y\n", "vault.example.yml": "x: y\n"}, 0),
    ],
)
def test_a_vault_that_is_not_encrypted_is_seen(tmp_path: Path, vaults: dict[str, str], status: int) -> None:
    for name, text in vaults.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    check = yaml.safe_load(OF_A_FLEET.read_text("utf-8"))["jobs"]["check"]["steps"]
    [line] = [one["run"] for one in check if one.get("name") == "What is named a vault is encrypted"]
    assert line in yaml.safe_load(OF_GITLAB.read_text("utf-8"))["check"]["script"]
    script = f"set -eo pipefail\n{line}\ntrue\n"  # a line of many, in GitLab
    done = subprocess.run(["bash", "-c", script], cwd=tmp_path, capture_output=True, check=False)  # noqa: S603, S607
    assert done.returncode == status
