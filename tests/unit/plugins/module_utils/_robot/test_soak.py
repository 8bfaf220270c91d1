# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What is watched before it is proven: which containers' ends count, what a look says, and when it is over."""

from __future__ import annotations

from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.poll import PASS, WAIT
from ansible_collections.rosops.fleet.plugins.module_utils._robot import soak
from ansible_collections.rosops.fleet.plugins.module_utils._robot.soak import (
    LOOKS,
    RATED,
    Soak,
    conditions,
    ended,
    worse,
)
from ansible_collections.rosops.fleet.plugins.module_utils._robot.way_back import Step
from ansible_collections.rosops.fleet.plugins.module_utils._ros.checks import Check
from ansible_collections.rosops.fleet.plugins.module_utils._ros.gate import Look
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
    state = {"waiting": {"reason": "CrashLoopBackOff"}} if waits else {"running": {}}
    status = {"state": state, "lastState": {"terminated": last} if last else {}, "restartCount": restarts}
    labels = {"rosops.fleet/app": "camera", "rosops.fleet/revision": "rev2"}
    return {"metadata": {"labels": labels}, "status": {"containerStatuses": [status]}}


def step(*pods: dict[str, Any], ready: bool = True, app: str = "camera", **said: Any) -> Step:
    there = live(version(app, 2), marked=False, ready=ready)
    return Step((member(there, left(version(app, 1), soak=120.0, **{**CONTRACT, **said}), pods),))


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
    assert ended(step(*pods, ends=known)) == why


def test_a_step_owes_its_contracts_and_counts_messages_now_and_then() -> None:
    nothing = {"topics": {}, "services": {}, "actions": [], "edges": []}
    beside = {**CONTRACT, **nothing, "node": "/rear_2", "nodes": ["/rear_2"]}
    owed = conditions(step(others=beside), rates=True)
    assert owed["nodes"] == ["/camera_2", "/rear_2"]
    [topic] = owed["topics"]
    assert (topic["min_rate"], topic["latched"], topic["publisher"]) == (18.0, True, "/camera_2")
    assert owed["edges"] == [
        {"publisher": "/camera_2", "topic": "/image", "subscriber": "/viewer", "peer": "subscriber"}
    ]
    assert conditions(step(), rates=False)["topics"] == [
        {"name": "/image", "publisher": "/camera_2", "type": "std_msgs/String"}
    ]
    assert conditions(step(app="ros-master"), rates=True)["nodes"] == []


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
    assert worse(Look(WAIT, checks)) == seen


class Looks:
    """What each look finds, and how each was asked."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, *found: Check) -> None:
        self.found, self.rated = [*found], list[bool]()
        monkeypatch.setattr(soak, "look", self.look)

    def look(self, _ros: Any, wanted: Any, _silence: Any) -> Look:
        self.rated.append(any(topic.min_rate for topic in wanted.topics))
        return Look(PASS, [self.found.pop(0) if self.found else UP])


def test_it_is_good_once_its_time_is_over_and_its_messages_were_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    looks, watch, one = Looks(monkeypatch), Soak(), step()
    for number in range(12):
        assert not watch.good(one), number
        watch.look([one], 10.0, None)  # type: ignore[arg-type]
    assert watch.good(one)
    assert looks.rated == [number % RATED == RATED - 1 for number in range(12)]


def test_looks_in_a_row_find_it_bad(monkeypatch: pytest.MonkeyPatch) -> None:
    Looks(monkeypatch, SLOW, SLOW, UP, SLOW, SLOW, SILENT, SLOW)
    watch, one, words = Soak(), step(), []
    for _look in range(7):
        watch.look([one], 10.0, None)  # type: ignore[arg-type]
        words.append(watch.bad(one))
    assert LOOKS == 3
    assert words == [""] * 6 + ["rate /image: 10 Hz of at least 18 Hz"]
    assert not watch.good(one)


def test_time_counts_only_while_it_can_be_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    looks, watch = Looks(monkeypatch, *[SILENT] * 50), Soak()
    for _look in range(50):
        watch.look([step()], 10.0, None)  # type: ignore[arg-type]
    assert (watch.watched[step().key].seconds, watch.bad(step())) == (0.0, "")
    watch.look([step(ready=False)], 10.0, None)  # type: ignore[arg-type]
    assert len(looks.rated) == 50  # a pod that is not ready is not asked for anything


def test_another_version_begins_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    Looks(monkeypatch)
    watch, one = Soak(), step()
    watch.look([one], 10.0, None)  # type: ignore[arg-type]
    watch.look([], 10.0, None)  # type: ignore[arg-type]
    assert watch.watched == {}
    watch.look([Step(one.members, begun=True)], 10.0, None)  # type: ignore[arg-type]
    assert watch.bad(one) == "others of its step went back"
