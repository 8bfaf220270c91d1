# SPDX-License-Identifier: GPL-3.0-or-later
"""Alerts: each has what a reader needs, a page, a case that fires and one that does not; promtool agrees."""

from __future__ import annotations

import json
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
TEXTS = ("summary", "description")
# in the cases a robot's name stands for the labels of all that is in its namespace
ROBOT, LABELS = re.compile(r"\{(robot\d)(?=[,}])"), r'{robot="\1",namespace="robot-\1"'
HEADINGS = ["## What it means", "## What to look at", "## What to do"]
REPOSITORY = yaml.safe_load((CHECKOUT / "galaxy.yml").read_text("utf-8"))["repository"]


def alerts() -> list[dict[str, Any]]:
    groups = [group for path in RULES for group in yaml.safe_load(path.read_text("utf-8"))["groups"]]
    return [rule for group in groups for rule in group["rules"] if "alert" in rule]


def cases(*paths: Path) -> list[dict[str, Any]]:
    return [case for path in paths for case in yaml.safe_load(path.read_text("utf-8"))]


def runbook(name: str) -> str:
    return f"{REPOSITORY}/blob/main/docs/runbooks/{name}.md"


def expected(name: str, texts: dict[str, str], alert: dict[str, str]) -> dict[str, Any]:
    """An alert that fires, as promtool has it; in texts its labels and its `value` stand in braces."""
    own = {key: alert.get(key, texts[key]).format(**alert) for key in TEXTS}
    labels = {key: said for key, said in alert.items() if key not in (*TEXTS, "value")}
    return {"exp_labels": labels, "exp_annotations": {**own, "runbook_url": runbook(name)}}


def unit_test(case: dict[str, Any]) -> dict[str, Any]:
    """A case, as promtool has it."""
    silent = [(name, at, []) for name, times in case.get("silent", {}).items() for at in times]
    fires = [
        (name, at, [expected(name, said, alert) for alert in alerts])
        for name, said in case.get("fires", {}).items()
        for at, alerts in said.items()
        if at not in TEXTS
    ]
    return {
        "name": case["name"],
        "interval": case.get("interval", "10s"),
        "input_series": [
            {"series": ROBOT.sub(LABELS, series), "values": values} for series, values in case["series"].items()
        ],
        "promql_expr_test": case.get("promql_expr_test", []),
        "alert_rule_test": [
            {"eval_time": at, "alertname": name, "exp_alerts": alerts} for name, at, alerts in (*silent, *fires)
        ],
    }


def test_all_alerts_are_there_and_each_has_a_case_that_fires_and_one_that_does_not() -> None:
    assert {rule["alert"] for rule in alerts()} == WANTED
    for kind in ("fires", "silent"):
        assert {name for case in cases(*CASES) for name in case.get(kind, {})} == WANTED


@pytest.mark.parametrize("rule", alerts(), ids=lambda rule: str(rule["alert"]))
def test_an_alert_says_how_bad_what_and_what_to_do(rule: dict[str, Any]) -> None:
    assert rule["labels"]["severity"] in ("critical", "warning", "info")
    assert set(rule["annotations"]) == {"summary", "description", "runbook_url"}
    assert rule["annotations"]["runbook_url"] == runbook(rule["alert"])


@pytest.mark.parametrize("name", sorted(WANTED))
def test_an_alert_has_a_runbook(name: str) -> None:
    text = (RUNBOOKS / f"{name}.md").read_text("utf-8")
    assert text.startswith(f"# {name}\n")
    assert [line for line in text.splitlines() if line.startswith("## ")] == HEADINGS
    for path in re.findall(r"`((?:roles|playbooks|docs)/[\w./-]+)`", text):
        assert (CHECKOUT / path).exists(), path


def test_every_runbook_is_of_an_alert() -> None:
    assert {path.stem for path in RUNBOOKS.glob("*.md")} - {"README"} == WANTED


def promtool() -> str:
    """By the variable PROMTOOL, from the lab's cache, or from PATH."""
    asked = subprocess.run([str(LAB), "program", "promtool", "--no-build"], capture_output=True, text=True, check=False)  # noqa: S603
    built = asked.stdout.strip() if asked.returncode == 0 else ""
    found = os.environ.get("PROMTOOL") or built or shutil.which("promtool")
    if not found:
        pytest.skip("no promtool: set PROMTOOL to its path, or build the lab's artifacts")
    return found


def agreed(*arguments: str) -> None:
    done = subprocess.run([promtool(), *arguments], capture_output=True, text=True, check=False)  # noqa: S603
    assert done.returncode == 0, done.stdout + done.stderr


def test_promtool_takes_the_rules() -> None:
    agreed("check", "rules", *map(str, RULES))


@pytest.mark.parametrize("path", CASES, ids=lambda path: str(path.stem))
def test_promtool_agrees_with_the_cases(path: Path, tmp_path: Path) -> None:
    rules = [str(RULES[0].with_name(name)) for name in ("recording.yml", path.name)]
    file = tmp_path / "tests.json"
    tests = [unit_test(case) for case in cases(path)]
    file.write_text(json.dumps({"rule_files": rules, "evaluation_interval": "10s", "tests": tests}), "utf-8")
    agreed("test", "rules", str(file))
