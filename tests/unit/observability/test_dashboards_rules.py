# SPDX-License-Identifier: GPL-3.0-or-later
"""Alerts: each has what a reader needs, a page, a case that fires and one that does not; promtool agrees."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest
import yaml

CHECKOUT = Path(__file__).resolve().parents[3]
RULES = sorted((CHECKOUT / "roles" / "observability" / "files" / "rules").glob("*.yml"))
CASES = sorted((CHECKOUT / "tests" / "rules").glob("*.yml"))
RUNBOOKS = CHECKOUT / "docs" / "runbooks"
LAB = CHECKOUT / "tests" / "lab" / "lab"
WANTED = {
    "RosMasterDown", "RosNodeDown", "RosTopicRateDrop", "RosTopicSilent", "RosExporterDown", "RobotUpdateStuck",
    "RobotUpdateFailed", "ReadinessFlapping", "RobotOffline", "ClockSkew", "DiskFillingUp", "PvcNearlyFull",
    "TelemetryBacklog", "LogsDropped", "CertExpiring",
}  # fmt: skip
HEADINGS = ["## What it means", "## What to look at", "## What to do"]


def alerts() -> list[dict[str, Any]]:
    groups = [group for path in RULES for group in yaml.safe_load(path.read_text("utf-8"))["groups"]]
    return [rule for group in groups for rule in group["rules"] if "alert" in rule]


def cases() -> list[dict[str, Any]]:
    tests = [test for path in CASES for test in yaml.safe_load(path.read_text("utf-8"))["tests"]]
    return [case for test in tests for case in test["alert_rule_test"]]


def test_all_alerts_are_there() -> None:
    assert {rule["alert"] for rule in alerts()} == WANTED


@pytest.mark.parametrize("rule", alerts(), ids=lambda rule: str(rule["alert"]))
def test_an_alert_says_how_bad_what_and_what_to_do(rule: dict[str, Any]) -> None:
    name = rule["alert"]
    repository = yaml.safe_load((CHECKOUT / "galaxy.yml").read_text("utf-8"))["repository"]
    assert rule["labels"]["severity"] in ("critical", "warning", "info")
    assert set(rule["annotations"]) == {"summary", "description", "runbook_url"}
    assert rule["annotations"]["runbook_url"] == f"{repository}/blob/main/docs/runbooks/{name}.md"


@pytest.mark.parametrize("name", sorted(WANTED))
def test_an_alert_has_a_runbook(name: str) -> None:
    text = (RUNBOOKS / f"{name}.md").read_text("utf-8")
    assert text.startswith(f"# {name}\n")
    assert [line for line in text.splitlines() if line.startswith("## ")] == HEADINGS
    for path in re.findall(r"`((?:roles|playbooks|docs)/[\w./-]+)`", text):
        assert (CHECKOUT / path).exists(), path


def test_every_runbook_is_of_an_alert() -> None:
    assert {path.stem for path in RUNBOOKS.glob("*.md")} - {"README"} == WANTED


@pytest.mark.parametrize("name", sorted(WANTED))
def test_an_alert_has_a_case_that_fires_and_one_that_does_not(name: str) -> None:
    own = [case for case in cases() if case["alertname"] == name]
    assert any(case["exp_alerts"] for case in own)
    silent = [
        test["name"]
        for path in CASES
        for test in yaml.safe_load(path.read_text("utf-8"))["tests"]
        if any(case["alertname"] == name and not case["exp_alerts"] for case in test["alert_rule_test"])
    ]
    assert silent


def promtool() -> str:
    """By the variable PROMTOOL, from the lab's cache, or from PATH."""
    named = os.environ.get("PROMTOOL")
    if named:
        return named
    asked = subprocess.run([str(LAB), "program", "promtool", "--no-build"], capture_output=True, text=True, check=False)  # noqa: S603
    path = asked.stdout.strip()
    if asked.returncode == 0 and path and Path(path).is_file():
        return path
    found = shutil.which("promtool")
    if not found:
        pytest.skip("no promtool: set PROMTOOL to its path, or build the lab's artifacts")
    return found


def test_promtool_takes_the_rules() -> None:
    run = [promtool(), "check", "rules", *map(str, RULES)]
    done = subprocess.run(run, capture_output=True, text=True, check=False)  # noqa: S603
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("path", CASES, ids=lambda path: str(path.stem))
def test_promtool_agrees_with_the_cases(path: Path) -> None:
    done = subprocess.run([promtool(), "test", "rules", str(path)], capture_output=True, text=True, check=False)  # noqa: S603
    assert done.returncode == 0, done.stdout + done.stderr
