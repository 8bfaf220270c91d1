# SPDX-License-Identifier: GPL-3.0-or-later
"""The keeper's client, against a small API server with TLS."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import KubeError
from ansible_collections.rosops.fleet.plugins.module_utils._robot import cluster_api
from ansible_collections.rosops.fleet.plugins.module_utils._robot.cluster_api import ApiError, Cluster
from ansible_collections.rosops.fleet.plugins.module_utils._step.objects import lease_with
from ansible_collections.rosops.fleet.plugins.module_utils._step.words import BACK_TO, KEEPER, SOAKING, UPDATING
from ansible_collections.rosops.fleet.tests.unit.plugins.module_utils._robot.cluster_around import (
    certificate,
    environment,
    start_server,
)
from ansible_collections.rosops.fleet.tests.unit.plugins.module_utils._robot.steps_left import version
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._kube.kube_server import Server

SPACE = "robot-r1"
DEPLOYMENTS = f"/apis/apps/v1/namespaces/{SPACE}/deployments"
NOBODYS = {"metadata": {"name": "robot-update", "namespace": SPACE}}
OURS = {"app.kubernetes.io/managed-by": "rosops.fleet"}


@pytest.fixture
def server(tmp_path: Path) -> Iterator[Server]:
    made = start_server(tmp_path, SPACE)
    yield made
    made.stop()


@pytest.fixture
def cluster(server: Server, tmp_path: Path) -> Cluster:
    return Cluster(environment(server), str(tmp_path))


def test_where_there_is_no_access_it_says_what_is_missing(tmp_path: Path) -> None:
    with pytest.raises(KubeError, match="no pod of a cluster"):
        Cluster({}, str(tmp_path))
    with pytest.raises(KubeError, match=r"no token is mounted at .* \(automountServiceAccountToken\)"):
        Cluster({"KUBERNETES_SERVICE_HOST": "10.43.0.1"}, str(tmp_path))


def test_it_reads_what_is_ours(cluster: Cluster, server: Server) -> None:
    assert cluster.namespaces() == [SPACE]
    assert cluster.lease(SPACE) is None
    assert cluster.config_map(SPACE, "camera-update") is None
    server.put(f"{DEPLOYMENTS}/camera", {"metadata": {"labels": OURS}})
    assert [item["metadata"]["name"] for item in cluster.deployments(SPACE)] == ["camera"]
    server.put(f"/api/v1/namespaces/{SPACE}/pods/camera-1", {"metadata": {"labels": OURS}})
    assert [item["metadata"]["name"] for item in cluster.pods(SPACE)] == ["camera-1"]
    found = cluster.deployment(SPACE, "camera")
    assert found is not None
    assert found["metadata"]["labels"] == OURS
    seen = [server.seen() for _request in range(4)]
    assert seen[0][1] == {"resourceVersion": "0"}
    assert seen[1][0] == f"/api/v1/namespaces/{SPACE}/configmaps/camera-update"
    assert seen[2][1] == {"labelSelector": "app.kubernetes.io/managed-by=rosops.fleet"}


def test_a_name_that_a_record_has_is_no_path(cluster: Cluster, server: Server) -> None:
    """What is none is looked for in vain, like any other: nobody takes it for an API that is away."""
    assert cluster.config_map(SPACE, "../a ü\n") is None
    assert server.seen()[0] == f"/api/v1/namespaces/{SPACE}/configmaps/..%2Fa%20%C3%BC%0A"


def test_the_token_is_read_anew(cluster: Cluster, server: Server, tmp_path: Path) -> None:
    cluster.lease(SPACE)
    (tmp_path / "token").write_text("second\n")
    cluster.lease(SPACE)
    assert [server.seen()[2]["authorization"] for _request in range(2)] == ["Bearer first", "Bearer second"]


def test_it_applies_as_a_run_does(cluster: Cluster, server: Server) -> None:
    """What the run's manager had and this one does not send is gone: the mark."""
    path, old = f"{DEPLOYMENTS}/camera", version("camera", 1, SPACE)
    marked = version("camera", 2, SPACE)
    marked["metadata"]["annotations"][UPDATING] = "1000"
    query = {"fieldManager": "rosops.fleet", "force": "true"}
    assert server.write("PATCH", path, query, marked, "application/apply-patch+yaml")[0] == 200
    cluster.apply(SPACE, old)
    assert server.owned[(path, "rosops.fleet")] == old
    assert server.find(path)["metadata"]["annotations"] == old["metadata"]["annotations"]


@pytest.mark.parametrize(("notes", "left"), [
    ({SOAKING: "1000", BACK_TO: "a"}, {}),
    # as an undo brings it back: what is beside a mark stays with it, else the API server refuses
    ({SOAKING: "1000", UPDATING: "900", BACK_TO: "a"}, {UPDATING: "900", BACK_TO: "a"}),
])  # fmt: skip
def test_a_mark_comes_off_with_what_is_beside_it(
    cluster: Cluster, server: Server, notes: dict[str, str], left: dict[str, str]
) -> None:
    item = version("camera", 1, SPACE)
    own = dict(item["metadata"]["annotations"])
    item["metadata"]["annotations"] |= notes
    cluster.unmark(SPACE, server.put(f"{DEPLOYMENTS}/camera", item), SOAKING)
    assert server.find(f"{DEPLOYMENTS}/camera")["metadata"]["annotations"] == {**own, **left}


def test_of_two_that_write_the_lease_one_has_it(cluster: Cluster, server: Server) -> None:
    first = cluster.write_lease(SPACE, lease_with(KEEPER, NOBODYS, KEEPER, 15, "T"))
    assert first is not None
    assert cluster.write_lease(SPACE, lease_with(KEEPER, NOBODYS, KEEPER, 15, "T")) is None
    second = cluster.write_lease(SPACE, lease_with("", first, KEEPER, 15, "T"))
    assert second is not None
    assert second["spec"]["holderIdentity"] == ""
    assert cluster.write_lease(SPACE, lease_with(KEEPER, first, KEEPER, 15, "T")) is None
    assert cluster.lease(SPACE, newest=True) == second
    assert server.seen()[1] == {}  # one that decides is not an older one


def test_it_evicts_this_very_pod_and_says_so(cluster: Cluster, server: Server, monkeypatch: pytest.MonkeyPatch) -> None:
    camera = {"metadata": {"name": "camera-1", "uid": "4711"}}
    cluster.evict(SPACE, camera, 10)
    asked = server.find(f"/api/v1/namespaces/{SPACE}/pods/camera-1/eviction/camera-1")
    assert (asked["apiVersion"], asked["kind"]) == ("policy/v1", "Eviction")
    assert asked["deleteOptions"] == {"gracePeriodSeconds": 10, "preconditions": {"uid": "4711"}}
    cluster.evict(SPACE, {"metadata": {"name": "arm-1", "uid": "4712"}}, None)
    asked = server.find(f"/api/v1/namespaces/{SPACE}/pods/arm-1/eviction/arm-1")
    assert asked["deleteOptions"] == {"preconditions": {"uid": "4712"}}
    for second in (1, 2):
        monkeypatch.setattr(cluster_api.time, "time", partial(float, 1767225600 + second))
        cluster.tell(SPACE, camera, "NodeHung", f"it hung {second} s")
    base = f"/api/v1/namespaces/{SPACE}/events/camera-1.2026010100000"
    events = [server.find(f"{base}{second}000000") for second in (1, 2)]
    assert [one["message"] for one in events] == ["it hung 1 s", "it hung 2 s"]
    about = {"apiVersion": "v1", "kind": "Pod", "name": "camera-1", "namespace": SPACE, "uid": "4711"}
    assert events[0]["involvedObject"] == about
    assert (events[0]["type"], events[0]["reason"]) == ("Warning", "NodeHung")


def test_a_refusal_is_an_error_with_what_was_said(cluster: Cluster, server: Server) -> None:
    server.refusals.append((403, "deployments is forbidden"))
    with pytest.raises(ApiError, match=rf"answered 403 for GET {DEPLOYMENTS}: .*deployments is forbidden") as caught:
        cluster.deployments(SPACE)
    assert caught.value.status == 403
    assert cluster.deployments(SPACE) == []


def test_a_server_that_was_restarted_is_found_again(cluster: Cluster, server: Server, tmp_path: Path) -> None:
    cluster.lease(SPACE)
    (link,) = cluster._left
    assert link.sock is not None
    link.sock.close()  # as after a restart: the connection that was kept is of no use
    assert cluster.deployments(SPACE) == []
    (anew,) = cluster._left
    assert anew is not link
    server.stop()
    anew.close()
    with pytest.raises(ApiError, match=r"cannot be reached: .*refused"):
        cluster.lease(SPACE)
    again = start_server(tmp_path, SPACE)
    cluster.port = again.server_address[1]
    assert cluster.lease(SPACE) is None
    again.stop()


def test_nobody_else_gets_the_token(cluster: Cluster, server: Server, tmp_path: Path) -> None:
    (tmp_path / "ca.crt").write_bytes(certificate()[0])
    with pytest.raises(ApiError, match="CERTIFICATE_VERIFY_FAILED"):
        cluster.lease(SPACE)
    assert server.requests.empty()


def test_a_shared_masters_keeper_finds_robots_that_are_added(server: Server, tmp_path: Path) -> None:
    (tmp_path / "namespace").write_text("fleet")
    at = [0.0]
    cluster = Cluster(environment(server), str(tmp_path), lambda: at[0])
    maps = "/api/v1/namespaces/fleet/configmaps"
    server.put(f"{maps}/robot-r1", {"metadata": {}})
    assert cluster.namespaces() == ["fleet", "robot-r1"]
    assert server.seen()[1] == {"labelSelector": "rosops.fleet/kept=true"}
    server.put(f"{maps}/robot-r2", {"metadata": {}})
    at[0] = cluster_api.REFRESH - 1
    assert cluster.namespaces() == ["fleet", "robot-r1"]
    at[0] = cluster_api.REFRESH
    assert cluster.namespaces() == ["fleet", "robot-r1", "robot-r2"]
