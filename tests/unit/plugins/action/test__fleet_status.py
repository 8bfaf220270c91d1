# SPDX-License-Identifier: GPL-3.0-or-later
"""What is shown of the fleet: on the screen and in the page."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.action import _fleet_status
from ansible_collections.rosops.fleet.tests.unit.plugins.action.actions import run

HOST = {"name": "robot1", "group": "robots", "cluster": "edge", "reachable": True}
PROBLEM = {"where": "cluster edge", "what": "does not answer: no answer within 60 s"}
ASKED = {"robot": "(shared)", "master_uri": "http://10.43.0.1:11311"}
FLEET = {"status": {"hosts": [HOST], "problems": [PROBLEM]}, "graphs": {"robot1": ASKED}, "read": {}}
GRAPH = {"nodes": {"/sensor": {"pid": 1}}, "topics": {"/t": {"type": "a/B", "rate": 10.0}}}


@pytest.fixture
def said(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    found: list[str] = []
    monkeypatch.setattr(_fleet_status.display, "display", found.append)
    return found


def show(page: Path | str, result: dict[str, Any], check_mode: bool = False, **more: Any) -> dict[str, Any]:
    args = {"fleet": FLEET, "graphs": "graph", "page": str(page)}
    return run(_fleet_status, args, {"hostvars": {"robot1": {"graph": result}}, **more}, check_mode)


def test_what_the_keeper_has_read_is_shown(said: list[str]) -> None:
    args = {"fleet": {**FLEET, "read": {"robot1": {"graph": GRAPH}}}, "graphs": "graph", "page": ""}
    found = run(_fleet_status, args, {"hostvars": {"robot1": {}}})
    assert said == [f"\n{found['text']}"] and "ROS graph of robot1" not in found["text"]


def test_a_second_look_changes_nothing(tmp_path: Path, said: list[str]) -> None:
    page = tmp_path / "fleet.html"
    first, second = (show(page, {"graph": GRAPH}, ansible_limit="robot1") for _turn in range(2))
    assert (first["changed"], second["changed"]) == (True, False)
    assert "/sensor" in page.read_text() and "<code>robot1</code>" in page.read_text()
    assert said == [f"\n{one['text']}" for one in (first, second)]
    assert "(shared)  /t     a/B" not in said[0] and "All tables" in said[0]


def test_tables_are_for_those_who_ask_for_more(monkeypatch: pytest.MonkeyPatch, said: list[str]) -> None:
    monkeypatch.setattr(_fleet_status.display, "verbosity", 1)
    found = show("", {"graph": GRAPH})
    assert "(shared)  /t     a/B" in said[0] and "All tables" not in said[0]
    assert found["_ansible_verbose_override"] is True  # Ansible's own print of it would be the same once more


@pytest.mark.parametrize("wanted", [True, False])
def test_check_mode_writes_nothing_nor_does_who_wants_no_page(tmp_path: Path, said: list[str], wanted: bool) -> None:
    page = tmp_path / "new" / "fleet.html" if wanted else ""
    assert show(page, {"graph": GRAPH}, check_mode=wanted)["changed"] is wanted
    assert list(tmp_path.iterdir()) == [] and said


def test_a_page_that_cannot_be_written_keeps_nobody_from_the_text(tmp_path: Path, said: list[str]) -> None:
    page = tmp_path / "fleet.html"
    page.mkdir()
    found = show(page, {"graph": GRAPH})
    assert found["failed"] is True and str(page) in found["msg"]
    assert list(tmp_path.iterdir()) == [page]
    assert said == [f"\n{found['text']}"]


@pytest.mark.parametrize(
    ("result", "problems"),
    [
        ({"graph": GRAPH}, []),
        ({"failed": True, "msg": "the master does not answer"}, ["the master does not answer"]),
        ({"unreachable": True, "msg": "timed out"}, []),
        ({}, ["failed without a message"]),
    ],
)
def test_a_graph_that_cannot_be_read_is_a_problem(said: list[str], result: dict[str, Any], problems: list[str]) -> None:
    show("", result)
    findings, _summary, counted = said[0].partition("SUMMARY")
    assert findings.startswith("\nNEEDS ATTENTION") and "x cluster edge: does not answer" in findings
    todo = "k3s kubectl -n fleet logs deploy/ros-master"
    told = "".join(f"  x ROS graph of robot1: {what}\n      do       {todo}\n" for what in problems)
    assert findings.partition("60 s\n")[2] == f"{told}\n"
    assert ("1 of 1 up" in counted.partition("ROS nodes")[2]) == ("graph" in result)


def test_a_graph_that_makes_no_sense_is_a_problem_of_that_robot(said: list[str]) -> None:
    """Whatever it is: test_hostile has more."""
    show("", {"graph": {"topics": {"/t": {"rate": "fast"}}}})
    assert "ROS graph of robot1: it makes no sense" in said[0]
    said.clear()
    # goals without number take no time
    action = {"type": "a/B", "up": True, "servers": ["/n"], "goals": {"ACTIVE": 10**15}}
    show("", {"graph": {"actions": {"/a": action}}})
    assert said
