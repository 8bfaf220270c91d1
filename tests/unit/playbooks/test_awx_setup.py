# SPDX-License-Identifier: GPL-3.0-or-later
"""What awx_setup makes of an AWX, by awx.awx's own modules, and what its questions and their answers are."""

from __future__ import annotations

import json
import re
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from ansible_collections.rosops.fleet.plugins.plugin_utils._validate.schema import variables
from ansible_collections.rosops.fleet.tests.unit.playbooks.awx_server import Awx
from ansible_collections.rosops.fleet.tests.unit.playbooks.control_node import CHECKOUT, ended, started
from jinja2 import ChainableUndefined, StrictUndefined
from jinja2.sandbox import ImmutableSandboxedEnvironment


class _Loader(yaml.SafeLoader):
    """Knows Ansible's own tag."""


_Loader.add_constructor("!unsafe", lambda loader, node: loader.construct_scalar(node))
OBJECTS: dict[str, Any] = yaml.load((CHECKOUT / "awx" / "objects.yml").read_text(), _Loader)  # noqa: S506 - a safe one
SETTINGS: dict[str, Any] = yaml.safe_load((CHECKOUT / "awx" / "settings.yml").read_text())
PLAYBOOK = CHECKOUT / "playbooks" / "awx_setup.yml"
SAID = {
    "awx_project_url": "https://git.example.org/fleet.git",
    "awx_execution_environment_image": "registry.example.org/ee:1",
    "awx_canary": "robot1,robot2",
    "awx_timezone": "Europe/Prague",
    "awx_vault_password": "hush-vault",
    "awx_update_answers": {"update_on_busy": "defer"},
    "awx_templates": {"fleet site": {"timeout": 7200, "labels": ["night"], "extra_vars": {"update_rate_seconds": 2}}},
    "awx_teams": {"run": "fleet operators", "approve": "fleet approvers", "change": "engineers", "read": ""},
    "awx_notifications": [{
        "name": "operators", "notification_type": "webhook",
        "notification_configuration": {"url": "https://chat.example.org/hush", "http_method": "POST", "headers": {}},
    }],
}  # fmt: skip


@pytest.fixture
def awx() -> Iterator[Awx]:
    made = Awx()
    yield made
    made.stop()


def setup(awx: Awx, folder: Path, *arguments: str, **said: Any) -> subprocess.CompletedProcess[str]:
    key, access = folder / "key", folder / "edge.yaml"
    key.write_text("hush-key\n")
    access.write_text("hush-kubeconfig\n")
    files = {"awx_ssh_key_file": str(key), "awx_kubeconfig_file": str(access)}
    variables = json.dumps({**SAID, **files, **said})
    environ = {"CONTROLLER_HOST": awx.url, "CONTROLLER_OAUTH_TOKEN": "hush-token", "ROSOPS_FLEET_REPORT": ""}
    return ended(started(folder, "localhost,", PLAYBOOK, *arguments, "-e", variables, **environ))


def test_where_awx_tells_why_it_cannot_take_a_repository_is_said(awx: Awx, tmp_path: Path) -> None:
    awx.syncs = False
    organization = awx.add("organizations", {"name": SETTINGS["awx_organization"]})
    awx.add("projects", {"name": SETTINGS["awx_project"], "organization": organization["id"]})
    failed = setup(awx, tmp_path, "--start-at-task", "Sync the projects, as AWX takes no playbook that it has not seen")
    (job,) = awx.objects["project_updates"]
    assert f"{awx.url}/api/v2/project_updates/{job['id']}/stdout/?format=txt" in " ".join(failed.stdout.split())
    assert "workflow_job_templates" not in awx.objects


def test_an_awx_has_it_all_and_a_second_run_changes_nothing(awx: Awx, tmp_path: Path) -> None:
    done = setup(awx, tmp_path, "--diff", "-v")
    assert done.returncode == 0
    assert "hush" not in done.stdout + done.stderr
    names = {kind: {one.get("name") for one in objects} for kind, objects in awx.objects.items()}
    assert names["job_templates"] == {one["name"] for one in OBJECTS["awx_job_templates"]}
    assert names["schedules"] == {one["name"] for one in OBJECTS["controller_schedules"]}
    assert {"fleet hosts", "fleet vault", "fleet cluster"} < names["credentials"]
    for template in awx.objects["job_templates"]:
        assert (template["become_enabled"], template["allow_simultaneous"]) == (False, False)
        assert template["job_slice_count"] == 1
        assert len(awx.associated[f"job_templates/{template['id']}/credentials"]) == 3
    # AWX's own environment may have an ansible-core that is too old
    assert awx.of("inventory_sources")["execution_environment"] == awx.of("execution_environments")["id"]
    site = awx.of("job_templates", "fleet site")
    assert (site["timeout"], site["extra_vars"]) == (7200, '{"update_rate_seconds": 2}')
    assert awx.associated[f"job_templates/{site['id']}/labels"] == [awx.of("labels", "night")["id"]]
    canary, word = awx.of("job_templates", "fleet update canary"), awx.of("notification_templates")
    assert awx.associated[f"job_templates/{canary['id']}/notification_templates_success"] == [word["id"]]
    assert word["messages"] == OBJECTS["awx_messages"]["webhook"]
    workflow = awx.of("workflow_job_templates")
    assert [one["name"] for one in awx.objects["teams"]] == ["fleet operators", "fleet approvers", "engineers"]
    assert awx.associated[f"roles/{workflow['id']}-approval/teams"] == [awx.of("teams", "fleet approvers")["id"]]
    executes = {
        one["name"]: awx.associated.get(f"roles/{one['id']}-execute/teams", [])
        for kind in ("job_templates", "workflow_job_templates")
        for one in awx.objects[kind]
    }
    run, change = (awx.of("teams", name)["id"] for name in ("fleet operators", "engineers"))
    # who needs a word starts nothing by itself that brings a change
    free = {"fleet rollback", "fleet status", "fleet validate", "fleet update with approval"}
    assert {name for name, teams in executes.items() if run in teams} == free
    assert {name for name, teams in executes.items() if change not in teams} == set()
    [asked] = [one for one in awx.surveys[f"workflow_job_templates/{workflow['id']}/survey_spec"]["spec"]
               if one["variable"] == "update_on_busy"]  # fmt: skip
    assert "force" not in asked["choices"]
    assert awx.of("schedules", "fleet update at night")["extra_data"] == {
        "update_waves": "1, 25%, 100%",
        "update_on_busy": "defer",
        "update_busy_timeout": 600,
        "update_failure_budget": "0",
    }
    nodes = {one["identifier"]: one for one in awx.objects["workflow_job_template_nodes"]}
    place = "workflow_job_template_nodes/{}/success_nodes"
    then = {name: awx.associated.get(place.format(one["id"])) for name, one in nodes.items()}
    assert then == {"canary": [nodes["approval"]["id"]], "approval": [nodes["others"]["id"]], "others": None}
    assert nodes["canary"]["limit"] == "edge:robot1:robot2"
    surveys = {awx.of("job_templates", name)["survey_enabled"] for name in ("fleet status", "fleet validate")}
    assert (surveys, site["survey_enabled"], workflow["survey_enabled"]) == ({False}, True, True)
    assert awx.of("schedules", "fleet update at night")["rrule"].startswith(
        "DTSTART;TZID=Europe/Prague:20260101T020000 RRULE:"
    )
    assert awx.of("credentials", "fleet cluster")["inputs"] == {"kubeconfig": "hush-kubeconfig\n"}
    kind = awx.of("credential_types", "Access to the fleet's cluster")
    assert kind["injectors"]["env"] == {"K8S_AUTH_KUBECONFIG": "{{ tower.filename.kubeconfig }}"}
    writes = len(awx.writes)
    # those that differ in more than words: with a survey and others, with tags, with a word to be sent
    few = [
        one for one in OBJECTS["awx_job_templates"] if one["name"].split()[-1] in ("site", "canary", "status", "k3s")
    ]
    again = setup(awx, tmp_path, awx_job_templates=few)
    assert re.search(r"localhost +: ok=\d+ +changed=0 ", again.stdout)
    assert "WARNING" not in again.stdout + again.stderr
    # so that a playbook that is new in the repository is known
    assert awx.writes[writes:] == [f"POST /api/v2/projects/{awx.of('projects')['id']}/update/"]
    # what an earlier version gave goes
    awx.associated[f"roles/{site['id']}-execute/teams"].append(run)
    setup(awx, tmp_path, "--start-at-task", "Make who may do what, and when it runs by itself", awx_job_templates=few)
    assert awx.associated[f"roles/{site['id']}-execute/teams"] == [change]


@pytest.mark.parametrize("name", ["awx_project_url", "awx_canary"])
def test_what_has_to_be_said_is_asked_for(awx: Awx, tmp_path: Path, name: str) -> None:
    done = setup(awx, tmp_path, **{name: ""})
    assert done.returncode == 2
    assert f"{name} has to be said; awx/settings.yml lists the variables" in done.stdout
    assert awx.writes == []


def test_questions_are_of_variables_that_there_are() -> None:
    known = {*variables(), "update_waves"}
    assert {one["variable"] for one in OBJECTS["awx_questions"].values()} <= known
    assert all((CHECKOUT / "playbooks" / one["playbook"]).exists() for one in OBJECTS["awx_job_templates"])


def test_defaults_fit_their_questions() -> None:
    """AWX's own rules: a choice is one of the choices, a text's length and a number within bounds; no multiselect."""
    for name, one in OBJECTS["awx_questions"].items():
        default = one["default"]
        if one["type"] == "multiplechoice":
            assert default in one["choices"], name
        elif one["type"] == "integer":
            assert one["min"] <= default <= one["max"], name
        else:
            assert one["type"] == "text"
            assert isinstance(default, str), name
            assert one["min"] <= len(default) <= one["max"], name


OUTCOMES = {
    "robot1": {"outcome": "rolled-back", "reason": 'talker: "0 Hz"', "steps": []},
    "robot2": {"outcome": "deferred-busy", "reason": "it works", "steps": []},
}
JOB = {"id": 22, "name": "fleet update", "status": "failed", "job_explanation": ""}
KILLED = "Job terminated due to timeout"


def told(kind: str, event: str, part: str, **job: Any) -> str:
    """A message as AWX makes it: by Jinja's sandbox, of a job that may have no artifacts."""
    sandbox = ImmutableSandboxedEnvironment(undefined=ChainableUndefined)
    text = OBJECTS["awx_messages"][kind][event][part]
    return sandbox.from_string(text).render(job={**JOB, **job}, url="https://awx/#/jobs/22")


def test_word_of_a_job_has_robots_outcomes_and_reasons() -> None:
    line = told("text", "error", "message", artifacts={"fleet_outcomes": OUTCOMES})
    assert line == "fleet update #22 failed: robot1 rolled-back, robot2 deferred-busy https://awx/#/jobs/22"
    body = told("text", "error", "body", artifacts={"fleet_outcomes": OUTCOMES})
    assert 'robot1: rolled-back: talker: "0 Hz"\n' in body
    hook = json.loads(told("webhook", "error", "body", artifacts={"fleet_outcomes": OUTCOMES}))
    assert hook["outcomes"] == OUTCOMES


@pytest.mark.parametrize("job", [{}, {"artifacts": {}}], ids=["a sync of the project", "killed"])
def test_word_of_a_job_without_outcomes_has_awxs_own(job: dict[str, Any]) -> None:
    said = {**job, "job_explanation": KILLED}
    assert KILLED in told("text", "error", "message", **said)
    assert KILLED in told("text", "error", "body", **said)
    hook = json.loads(told("webhook", "error", "body", **said))
    assert (hook["explanation"], hook["outcomes"]) == (KILLED, {})


def test_awx_takes_the_messages() -> None:
    """It renders each of a job that it makes up, and takes none that names what there is not."""
    strict = ImmutableSandboxedEnvironment(undefined=StrictUndefined)
    known = {"job": {**JOB, "artifacts": {}}, "url": "u", "workflow_url": "w", "approval_node_name": "a"}
    for kind, events in OBJECTS["awx_messages"].items():
        for parts in (events["success"], events["error"], events["workflow_approval"]["running"]):
            made = {
                part: strict.from_string(text).render({**known, "approval_status": "running"})
                for part, text in parts.items()
            }
            assert "\n" not in made.get("message", "")
            assert kind != "webhook" or json.loads(made["body"])


def test_a_workflow_is_not_taken_for_a_slice() -> None:
    """By its name: AWX names the workflow of a sliced job template as that."""
    workflows = {one["name"] for one in OBJECTS["controller_workflows"]}
    assert not workflows & {one["name"] for one in OBJECTS["awx_job_templates"]}


def test_the_settings_are_those_that_are_read() -> None:
    text = PLAYBOOK.read_text() + (CHECKOUT / "awx" / "objects.yml").read_text()
    read = set(re.findall(r"\bawx_[a-z_]+", text)) - set(OBJECTS) - {"awx_setup", "awx_access"}
    assert set(SETTINGS) == read
