# SPDX-License-Identifier: GPL-3.0-or-later
"""The soak: which containers' ends count, what a look says, and when it is over."""

from __future__ import annotations

from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.poll import PASS, WAIT
from ansible_collections.rosops.fleet.plugins.module_utils._robot import soak
from ansible_collections.rosops.fleet.plugins.module_utils._robot.way_back import Step
from ansible_collections.rosops.fleet.plugins.module_utils._ros.checks import Check
from ansible_collections.rosops.fleet.plugins.module_utils._ros.gate import Look
from ansible_collections.rosops.fleet.tests.unit.plugins.module_utils._robot import steps_left
from ansible_collections.rosops.fleet.tests.unit.plugins.module_utils._robot.steps_left import (
    left,
    live,
    member,
    version,
)

ERROR = {"exitCode": 1, "reason": "Error"}
TOPIC = {"type": "std_msgs/String", "rate": 20.0, "publishers": {"/camera_2": {"rate": 20.0, "latched": True}}}
CONTRACT: dict[str, Any] = {
    "node": "/camera_2", "nodes": ["/camera_2"], "topics": {"/image": TOPIC}, "services": {"/zoom": {}},
    "actions": ["/scan"], "edges": [["/camera_2", "/image", "/viewer"]], "tolerance": 0.1,
}  # fmt: skip


def pod(restarts: int = 0, last: dict[str, Any] | None = None, *, waits: bool = False) -> dict[str, Any]:
    made = steps_left.pod("camera", 2, crashes=waits, ended=last)
    made["status"]["containerStatuses"][0]["restartCount"] = restarts
    return made


def step(*pods: dict[str, Any], ready: bool = True, app: str = "camera", **said: Any) -> Step:
    there = live(version(app, 2), marked=False, ready=ready)
    return Step((member(there, left(version(app, 1), **{"soak": 120.0, **CONTRACT, **said}), pods),))


@pytest.mark.parametrize(
    ("pods", "known", "why"),
    [
        ([pod()], 0, ""),
        ([pod(1, ERROR)], 1, ""),  # it had ended before the run found it good
        ([pod(2, ERROR)], 1, "camera ended once with exit code 1"),
        ([pod(1, {"exitCode": 0})], 0, ""),  # somebody may have ended it
        ([pod(2, {"exitCode": 0})], 0, "camera ended 2 times"),
        ([pod(1, {"exitCode": 255, "reason": "Unknown"})], 0, ""),  # its host has started anew
        ([pod(1, {"exitCode": 137, "reason": "OOMKilled"})], 0, "camera ended once with exit code 137 (out of memory)"),
        ([pod(waits=True)], 0, "camera crashes again and again"),
    ],
)
def test_which_ends_count(pods: list[dict[str, Any]], known: int, why: str) -> None:
    assert soak.ended(step(*pods, ends=known), {}) == why


REBOOT, BY_HAND = {"exitCode": 255, "reason": "Unknown"}, {"exitCode": 0}


@pytest.mark.parametrize(
    ("lives", "why"),
    [
        ([REBOOT, REBOOT], ""),
        ([None, REBOOT, REBOOT, {**REBOOT, "exitCode": 137, "reason": "ContainerStatusUnknown"}], ""),
        ([REBOOT, BY_HAND], ""),
        ([BY_HAND, REBOOT, BY_HAND], ""),
        ([REBOOT, BY_HAND, BY_HAND], "camera ended 2 times"),
        ([REBOOT, REBOOT, ERROR], "camera ended once with exit code 1"),
    ],
)
@pytest.mark.parametrize("seen", ["each", "the last ones, by a keeper whose host has started anew with it"])
def test_a_reboot_of_its_host_is_no_end_of_the_version(
    monkeypatch: pytest.MonkeyPatch, lives: list[dict[str, Any] | None], why: str, seen: str
) -> None:
    looks = Looks(monkeypatch)
    last_reboot = max(number for number, last in enumerate(lives) if last and last is not BY_HAND and last is not ERROR)
    for number in range(0 if seen == "each" else last_reboot, len(lives)):
        (found,) = looks.after(step(pod(number + 3, lives[number]), ends=2))
    assert found.why == why


def test_a_step_owes_its_contracts_and_counts_messages_now_and_then() -> None:
    nothing = {"topics": {}, "services": {}, "actions": [], "edges": []}
    beside = {**CONTRACT, **nothing, "node": "/rear_2", "nodes": ["/rear_2"]}
    owed = soak.conditions(step(others=beside), rates=True)
    assert owed["nodes"] == ["/camera_2", "/rear_2"]
    [topic] = owed["topics"]
    assert (topic["min_rate"], topic["latched"], topic["publisher"]) == (18.0, True, "/camera_2")
    assert owed["edges"] == [
        {"publisher": "/camera_2", "topic": "/image", "subscriber": "/viewer", "peer": "subscriber"}
    ]
    assert soak.conditions(step(), rates=False)["topics"] == [
        {"name": "/image", "publisher": "/camera_2", "type": "std_msgs/String"}
    ]
    assert soak.conditions(step(app="ros-master"), rates=True)["nodes"] == []


UP = Check("node", "/camera_2", PASS, "up")
REFUSED = Check("node", "/camera_2", WAIT, "down", {"uri": "http://10.42.0.9:1/", "refused": True})
SILENT = Check("node", "/camera_2", WAIT, "no answer", {"uri": "http://10.42.0.9:1/", "refused": False})
LOST = Check("node", "/camera_2", WAIT, "not registered with the master")
SLOW = Check("rate", "/image", WAIT, "10 Hz of at least 18 Hz")
UNHEARD = Check("edge", "/a -> /image -> /b", WAIT, "/b is registered, but down", {"silent": ["/b"]})
NO_MASTER = Check("master", "http://ros-master:11311", WAIT, "the ROS master does not answer")


@pytest.mark.parametrize(
    ("checks", "seen"),
    [
        ([UP], ""),
        ([UP, SLOW], "rate /image: 10 Hz of at least 18 Hz"),
        ([REFUSED], "node /camera_2: down"),
        ([LOST], "node /camera_2: not registered with the master"),
        ([SILENT, SLOW], None),
        ([UP, UNHEARD], ""),
        ([NO_MASTER, SLOW], None),
    ],
)
def test_what_cannot_be_seen_says_nothing(checks: list[Check], seen: str | None) -> None:
    assert soak.worse(Look(WAIT, checks)) == seen


class Looks:
    """Looks, ten seconds apart: what each finds, and how each was asked."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, *found: Check) -> None:
        self.found, self.rated, self.soaking = [*found], list[bool](), dict[str, soak.Soaking]()
        monkeypatch.setattr(soak, "look", self.look)

    def after(self, *steps: Step) -> list[soak.Soaking]:
        """What is known of these after the next look."""
        self.soaking = soak.soaked(self.soaking, steps, 10.0, None)  # type: ignore[arg-type]
        return [*self.soaking.values()]

    def look(self, _ros: Any, wanted: Any, _silence: Any) -> Look:
        self.rated.append(any(topic.min_rate for topic in wanted.topics))
        return Look(PASS, [self.found.pop(0) if self.found else UP])


def test_it_is_good_once_its_time_is_over_and_its_messages_were_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    looks = Looks(monkeypatch)
    assert [looks.after(step())[0].good for _look in range(12)] == [False] * 11 + [True]
    assert looks.rated == [number % soak.RATED == soak.RATED - 1 for number in range(12)]
    assert not Looks(monkeypatch).after(step(soak=10))[0].good  # nobody has counted yet


def test_looks_in_a_row_find_it_bad(monkeypatch: pytest.MonkeyPatch) -> None:
    looks = Looks(monkeypatch, SLOW, SLOW, UP, SLOW, SLOW, SILENT, SLOW)
    seen = [looks.after(step(soak=50))[0] for _look in range(7)]
    assert soak.LOOKS == 3
    assert [one.why for one in seen] == [""] * 6 + ["rate /image: 10 Hz of at least 18 Hz"]
    assert not seen[-1].good


def test_time_counts_only_while_it_can_be_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    looks = Looks(monkeypatch, *[SILENT] * 50)
    for _look in range(50):
        (seen,) = looks.after(step())
    assert (seen.seconds, seen.why) == (0.0, "")
    looks.after(step(ready=False))
    assert len(looks.rated) == 50  # a pod that is not ready is not asked for anything


def test_another_version_begins_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    looks, one = Looks(monkeypatch), step()
    for steps, seconds in (([one], [10.0]), ([], []), ([one], [10.0])):
        assert [seen.seconds for seen in looks.after(*steps)] == seconds
    (seen,) = looks.after(Step(one.members, begun=True))
    assert seen.why == "others of its step went back"
