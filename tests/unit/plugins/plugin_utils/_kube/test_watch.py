# SPDX-License-Identifier: GPL-3.0-or-later
"""Watches, against an API server in this process."""

from __future__ import annotations

import threading
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._step.objects import name_of
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube import watch as _watch
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.cache import Ref
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.client import Kube
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.watch import StreamEvent, Watch
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._kube.kube_objects import obj
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._kube.kube_server import CUT, END, Server

PODS = Ref("Pod", "", "robot-robot1")
GONE = {"type": "ERROR", "object": {"kind": "Status", "code": 410, "message": "too old"}}


def take(watch: Watch, count: int) -> list[StreamEvent]:
    """The next changes; a test that waits for one that never comes ends here."""
    found: list[StreamEvent] = []
    while len(found) < count:
        new = watch.changes(10)
        assert new, f"only {[change.what for change in found]} came"
        found += new
    return found


def told(changes: list[StreamEvent]) -> list[tuple[str, list[str]]]:
    return [(change.what, [name_of(one) for one in change.objects]) for change in changes]


def test_a_list_then_what_changes(server: Server, kube: Kube) -> None:
    server.lists[PODS.path] = [obj("Pod", "a")]
    with Watch(kube, [PODS]) as watch:
        assert told(take(watch, 1)) == [("listed", ["a"])]
        assert server.next_watch()[1]["resourceVersion"] == "100"
        server.send(PODS.path, "ADDED", obj("Pod", "b"))
        server.send(PODS.path, "MODIFIED", obj("Pod", "b"))
        server.send(PODS.path, "DELETED", obj("Pod", "a"))
        assert told(take(watch, 3)) == [("set", ["b"]), ("set", ["b"]), ("gone", ["a"])]


def test_several_lists_at_once(server: Server, kube: Kube) -> None:
    nodes = Ref("Node", "")
    with Watch(kube, [PODS, nodes]) as watch:
        assert {(change.what, change.target) for change in take(watch, 2)} == {("listed", PODS), ("listed", nodes)}
        server.send(nodes.path, "ADDED", obj("Node", "robot1"))
        server.send(PODS.path, "ADDED", obj("Pod", "a"))
        assert {change.target for change in take(watch, 2)} == {PODS, nodes}


@pytest.mark.parametrize("how", [END, CUT, GONE, {"unexpected": True}])
def test_whatever_ends_a_watch_it_begins_anew_with_a_list(server: Server, kube: Kube, how: Any) -> None:
    with Watch(kube, [PODS]) as watch:
        take(watch, 1)
        server.next_watch()
        server.lists[PODS.path], server.version = [obj("Pod", "a")], 200
        server.events(PODS.path).put(how)
        assert told(take(watch, 1)) == [("listed", ["a"])]
        assert server.next_watch()[1]["resourceVersion"] == "200"
        server.send(PODS.path, "ADDED", obj("Pod", "b"))
        assert told(take(watch, 1)) == [("set", ["b"])]


def test_a_server_that_is_away_for_a_while(server: Server, kube: Kube) -> None:
    server.refusals += [(503, "starting"), (500, "etcd leader changed"), (410, "too old")]
    with Watch(kube, [PODS]) as watch:
        changes = take(watch, 4)
    assert [change.what for change in changes] == ["lost", "lost", "lost", "listed"]
    assert "starting" in str(changes[0].error)


@pytest.mark.parametrize("status", [401, 403])
def test_what_no_retry_mends_ends_the_stream(server: Server, kube: Kube, status: int) -> None:
    server.refusals.append((status, "go away"))
    with Watch(kube, [PODS]) as watch:
        (change,) = take(watch, 1)
    assert change.what == "refused"
    assert change.error is not None
    assert change.error.status == status


@pytest.mark.parametrize(("count", "end"), [(3, "listed"), (20, "refused")])
def test_credentials_that_worked_get_some_more_chances(
    server: Server, kube: Kube, monkeypatch: pytest.MonkeyPatch, count: int, end: str
) -> None:
    monkeypatch.setattr(_watch, "FIRST_PAUSE", 0.001)
    monkeypatch.setattr(_watch, "LONGEST_PAUSE", 0.001)
    with Watch(kube, [PODS]) as watch:
        take(watch, 1)
        server.refusals += [(401, "still starting")] * count
        server.events(PODS.path).put(END)
        whats: list[str] = []
        while end not in whats:
            whats += [change.what for change in take(watch, 1)]
    assert whats == ["lost"] * min(count, _watch.REFUSALS_BORNE) + [end]


def test_leaving_ends_the_threads(server: Server, kube: Kube) -> None:
    with Watch(kube, [PODS, Ref("Node", "")]) as watch:
        take(watch, 2)
        server.next_watch()
        server.next_watch()
    assert [thread for thread in threading.enumerate() if thread.name.startswith("watch ")] == []
