# SPDX-License-Identifier: GPL-3.0-or-later
"""The robot's cluster: whose the robot is, writes within the Lease, and what nodes say."""

from __future__ import annotations

import contextlib
import functools
import os
import re
import threading
import time
from collections.abc import Iterator
from typing import Any
from unittest.mock import Mock

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import KubeError, NotReadyError
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.client import Kube
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.lease import Hold
from ansible_collections.rosops.fleet.plugins.plugin_utils._update import cluster
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.cluster import (
    SURE_SECONDS,
    KubeCluster,
    _Claim,
    is_server,
    robots_on,
    run_name,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.world import HeldError, LostError, ticking
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._kube.kube_server import Clock, Server
from ansible_collections.rosops.fleet.tests.unit.robots import robot


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def ours(server: Server) -> Iterator[KubeCluster]:
    server.put("/api/v1/namespaces/r", {"metadata": {}})
    with Kube({"host": server.url, "api_key": "t"}) as kube:
        yield KubeCluster(kube, lambda _text: None, "us")


def test_within_its_time_nobody_else_can_have_it_and_after_it_the_api_says_whose_it_is(clock: Clock) -> None:
    """It began when the renewal was sent: the answer may have come long after the API server wrote it."""
    lease = Mock()
    mine, other = (_Claim(lease, clock.now) for _run in range(2))
    clock.time = SURE_SECONDS - 0.1
    mine.confirm()
    assert not lease.renew.called
    clock.time = SURE_SECONDS
    lease.renew.side_effect = lambda: (clock.sleep(8.0), Hold(True, "us"))[1]
    mine.confirm()  # nobody wanted it
    clock.time = 2 * SURE_SECONDS
    # what was lost once stays lost
    lease.renew.side_effect = [KubeError("away"), Hold(False, "laptop, process 7", "noon"), Hold(True, "us")]
    with pytest.raises(KubeError):
        mine.confirm()
    for _time in range(2):
        with pytest.raises(LostError, match="laptop, process 7 has this robot since noon"):
            mine.confirm()
    lease.renew.side_effect = [Hold(False, "")]  # taken, and let go
    with pytest.raises(LostError, match="another one had this robot"):
        other.confirm()


# --- writes, and whose the robot is then ----------------------------------------------------------------------------

MAP = {"apiVersion": "v1", "kind": "ConfigMap", "metadata": {"name": "a", "namespace": "r"}, "data": {}}
MAP_PATH = "/api/v1/namespaces/r/configmaps/a"
LEASE_PATH = "/apis/coordination.k8s.io/v1/namespaces/r/leases/robot-update"
BACK = 40.0  # seconds until the API is there again


class Lapsing(Server):
    """An API server that goes away for longer than a Lease lasts."""

    def __init__(self, clock: Clock) -> None:
        super().__init__()
        self.lists["/api/v1/namespaces"] = [{"metadata": {"name": "r"}}]
        self.clock, self.gone = clock, False
        self.tried: list[tuple[str, float]] = []  # writes, and when
        self.refuse = lambda _path: 503 if self.is_away() else 0

    def is_away(self) -> bool:
        return self.gone and self.clock.time < BACK

    def write(self, method: str, path: str, query: dict[str, str], body: Any, content: str) -> tuple[int, Any]:
        self.tried.append((path, self.clock.time))
        return (503, "etcd is away") if self.is_away() else super().write(method, path, query, body, content)


@pytest.fixture
def lapsing(clock: Clock, monkeypatch: pytest.MonkeyPatch) -> Iterator[Lapsing]:
    server = Lapsing(clock)
    monkeypatch.setattr(cluster, "RENEW_SECONDS", 3600.0)  # nobody renews beside
    monkeypatch.setattr(cluster, "_Claim", functools.partial(_Claim, now=clock.now))
    yield server
    server.stop()


def test_a_write_is_tried_again_only_within_the_lease(clock: Clock, lapsing: Lapsing) -> None:
    said = list[str]()
    kube = Kube({"host": lapsing.url, "api_key": "t"}, say=said.append, now=clock.now, sleep=clock.sleep)
    ours = KubeCluster(kube, said.append, "us")
    with ours.claim("r"):
        lapsing.gone = True
        lapsing.lists["/api/v1/namespaces/r/configmaps"] = [MAP]
        lapsing.refuse = lambda path: 503 if lapsing.is_away() and path != MAP_PATH else 0  # reads of it go on
        ours.apply([{**MAP, "data": {"a": "1"}}])
    when = [at for path, at in lapsing.tried if path == MAP_PATH]
    assert when[0] < SURE_SECONDS
    assert [at for at in when if at >= SURE_SECONDS] == when[-1:]  # the one after it was renewed
    renewed = next(at for path, at in lapsing.tried if path == LEASE_PATH and at >= BACK)
    assert renewed <= when[-1]
    assert lapsing.find(MAP_PATH)["data"] == {"a": "1"}
    assert "nothing is written until it is renewed" in " ".join(said)


def test_a_write_that_comes_too_late_is_none(clock: Clock, lapsing: Lapsing) -> None:
    kube = Kube({"host": lapsing.url, "api_key": "t"}, now=clock.now, sleep=clock.sleep)
    ours = KubeCluster(kube, print, "us")
    with ours.claim("r"):
        lapsing.gone = True
        mine = lapsing.find(LEASE_PATH)
        lapsing.put(LEASE_PATH, {**mine, "spec": {**mine["spec"], "holderIdentity": "laptop"}})  # as it could reach it
        with pytest.raises(LostError, match="laptop has this robot"):
            ours.apply([MAP])
    assert lapsing.find(MAP_PATH) is None


def test_two_runs_of_one_host_name_and_one_process_number_are_two(
    server: Server, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As in two containers of one image, and as two workers of one run are."""
    server.put("/api/v1/namespaces/robot-robot1", {"metadata": {}})
    with Kube({"host": server.url, "api_key": "t"}) as kube:
        awx = {"awx_job_id": 22, "awx_job_template_name": "fleet update"}
        assert re.fullmatch(r"AWX job 22 \(fleet update\), [0-9a-f]{8}", run_name(awx))
        one, other = (KubeCluster(kube, print, run_name({})) for _run in range(2))
        with one.claim("robot-robot1"):
            (mine,) = one._claims
            monkeypatch.setattr(time, "sleep", lambda _seconds: mine._renew())
            told = f"process {os.getppid()} .* changes this robot"
            with pytest.raises(HeldError, match=told), other.claim("robot-robot1"):
                pytest.fail("both have it")
            one.confirm()


def leased(server: Server, holder: str, seconds: int = 15, renewed: int = 0) -> None:
    """Somebody has written the Lease, at noon of a day and some microseconds."""
    spec = {"holderIdentity": holder, "leaseDurationSeconds": seconds, "acquireTime": "noon"}
    written = {**spec, "renewTime": f"2026-07-01T00:00:00.{renewed:06}Z"}
    server.put(LEASE_PATH, {"metadata": {"namespace": "r"}, "spec": written})


def test_the_hold_of_another_tool_is_not_waited_for_but_after_its_end(
    server: Server, ours: KubeCluster, monkeypatch: pytest.MonkeyPatch
) -> None:
    leased(server, "rosops-may/apt", seconds=600)
    monkeypatch.setattr(time, "time", lambda: 1782864000.0 + 599)
    monkeypatch.setattr(time, "sleep", lambda _seconds: pytest.fail("it waits"))
    told = "rosops-may/apt holds this robot since noon; let that end"
    with pytest.raises(HeldError, match=told), ours.claim("r"):
        pytest.fail("the owner has it")
    # a keeper would have freed it by now; where there is none it ends as that of a run
    monkeypatch.setattr(time, "time", lambda: 1782864000.0 + 600)
    monkeypatch.setattr(time, "sleep", lambda _seconds: leased(server, ""))
    with ours.claim("r"):
        assert server.find(LEASE_PATH)["spec"]["holderIdentity"] == "us"


@pytest.mark.parametrize(("looks", "told"), [(4, ""), (9999, "ros-keeper changes this robot since noon")])
def test_a_keeper_that_takes_back_what_a_killed_run_left_is_waited_for_and_not_for_ever(
    server: Server, ours: KubeCluster, monkeypatch: pytest.MonkeyPatch, looks: int, told: str
) -> None:
    pauses = list[float]()

    def pause(seconds: float) -> None:
        pauses.append(seconds)
        leased(server, "ros-keeper" if len(pauses) < looks else "", renewed=len(pauses))

    leased(server, "a run that was killed")
    monkeypatch.setattr(time, "time", lambda: 1782864000.0)
    monkeypatch.setattr(time, "sleep", pause)
    with pytest.raises(HeldError, match=told) if told else contextlib.nullcontext(), ours.claim("r"):
        assert server.find(LEASE_PATH)["spec"]["holderIdentity"] == "us"
    assert sum(pauses) == pytest.approx(cluster.KEEPER_SECONDS if told else 2.0, abs=1.0)


def test_the_time_of_a_claim_begins_before_it_is_asked_for(
    clock: Clock, lapsing: Lapsing, monkeypatch: pytest.MonkeyPatch
) -> None:
    acquire = cluster.Lease.acquire
    monkeypatch.setattr(cluster.Lease, "acquire", lambda lease: (clock.sleep(SURE_SECONDS), acquire(lease))[1])
    ours = KubeCluster(Kube({"host": lapsing.url, "api_key": "t"}), print, "us")
    with ours.claim("r"):
        before = len(lapsing.tried)
        ours.confirm()
        assert [path for path, _at in lapsing.tried[before:]] == [LEASE_PATH]  # it is renewed already


# --- a cluster of which one node is to be changed ---------------------------------------------------------------------

NODE = {"apiVersion": "v1", "kind": "Node", "metadata": {"name": "edge1"}}


def node(name: str, server: bool, ready: str = "True") -> dict[str, Any]:
    labels = {"node-role.kubernetes.io/control-plane": "true"} if server else {}
    conditions = [{"type": "Ready", "status": ready, "message": "kubelet stopped"}]
    status = {"nodeInfo": {"kubeletVersion": "v1.34.2+k3s1"}, "conditions": conditions}
    return {"metadata": {"name": name, "labels": labels, "uid": name}, "status": status}


def test_when_a_kubelet_was_heard_of(server: Server, ours: KubeCluster) -> None:
    assert ours.beat("edge1") == ""
    lease = {"metadata": {"name": "edge1"}, "spec": {"renewTime": "2026-11-22T07:00:00.000000Z"}}
    server.lists["/apis/coordination.k8s.io/v1/namespaces/kube-node-lease/leases"] = [lease]
    assert ours.beat("edge1") == "2026-11-22T07:00:00.000000Z"


@pytest.mark.parametrize(("place", "there"), [("robot-robot1", ["robot1"]), ("fleet", ["robot2", "robot3"])])
def test_robots_with_pods_on_a_node(server: Server, ours: KubeCluster, place: str, there: list[str]) -> None:
    """A shared master and apps of the fleet have their pods beside all robots' namespaces."""
    chart = {"name": "map", "scope": "fleet", "placement": "remote", "image": "x.org/map:1"}
    robots = [
        robot(name="robot1"),
        robot(name="robot2", master={"mode": "shared"}),
        robot(chart, name="robot3"),
        robot(chart, name="robot4", mode="standalone"),
    ]
    server.lists["/api/v1/pods"] = [{"metadata": {"name": "a", "namespace": place}}]
    assert [one.name for one in robots_on(ours._kube, "edge1", robots)] == there
    path, query, _headers = server.requests.get()
    assert (path, query) == ("/api/v1/pods", {"fieldSelector": "spec.nodeName=edge1"})


def test_a_node_is_waited_for_until_it_is_ready(server: Server, ours: KubeCluster) -> None:
    server.lists["/api/v1/nodes"] = [node("edge1", True)]
    ours.wait([NODE], 5.0)
    server.lists["/api/v1/nodes"] = [node("edge1", True, "Unknown")]
    with pytest.raises(NotReadyError, match="edge1"):
        ours.wait([NODE], 0.2)


@pytest.mark.parametrize(
    ("how", "strict", "watched"), [({}, False, 0.0), ({"stay": 7.0}, True, 7.0), ({"begun": True}, True, 0.0)]
)
def test_what_ends_counts_where_it_is_watched(
    ours: KubeCluster, how: Any, strict: bool, watched: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Over all waits of a run: what had ended before the first of them is none of it."""
    asked = list[Any]()
    monkeypatch.setattr(cluster, "wait_for_rollout", lambda _kube, _refs, options: asked.append(options))
    for _time in range(2):
        ours.wait([NODE], 5.0, **how)
    found = {(one.timeout, one.fail_on_restart, one.watched, one.begun) for one in asked}
    assert found == {(5.0, strict, watched, "begun" in how)}
    assert (asked[0].before is asked[1].before) == strict


def test_servers() -> None:
    assert [is_server(one) for one in (node("edge1", True, "False"), node("robot1", False))] == [True, False]


def test_it_ticks_until_the_block_ends() -> None:
    ticked, threads = threading.Event(), threading.active_count()
    with ticking(0.001, ticked.set):
        assert ticked.wait(60.0)
    assert threading.active_count() == threads


def labelled(**labels: str) -> dict[str, Any]:
    own = {f"node-restriction.kubernetes.io/rosops-{name}": value for name, value in labels.items()}
    return {"metadata": {"name": "n", "labels": own}}


@pytest.mark.parametrize(
    ("nodes", "found"),
    [
        ([], False),  # nobody knows of any: whatever is wanted waits for one
        ([labelled()], True),
        ([labelled(robot="robot1")], False),
        ([labelled(), labelled(robot="robot1")], False),  # one that says by itself that it is the robot's
    ],
)
def test_whether_a_robot_s_nodes_have_no_labels_but_the_old_ones(
    server: Server, ours: KubeCluster, nodes: list[dict[str, Any]], found: bool
) -> None:
    server.lists["/api/v1/nodes"] = nodes
    assert ours.unlabelled(robot()) is found
    _path, query, _headers = server.seen()
    assert query["labelSelector"] == "rosops.fleet/robot=robot1"


def test_of_remote_apps_the_edge_hosts_are_asked_for(server: Server, ours: KubeCluster) -> None:
    server.lists["/api/v1/nodes"] = [labelled(robot="robot1")]
    assert ours.unlabelled(robot({"name": "a", "image": "a:1", "placement": "remote"}))
    asked = [server.seen()[1]["labelSelector"] for _place in ("local", "remote")]
    assert asked == ["rosops.fleet/robot=robot1", "deploymentType=remote"]
