# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Credentials, requests and watches, against an API server in this process."""

from __future__ import annotations

import socket
import threading
from pathlib import Path
from typing import Any, Iterator

import pytest
import yaml
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import KubeError
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube import watch as _watch
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.client import ApiError, Kube, Target, resolve_auth
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.watch import Change, Watch
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._kube.kube_objects import obj
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._kube.kube_server import CUT, END, GONE, Server

pytest.importorskip("kubernetes")

PODS = Target("Pod", "robot-robot1")


@pytest.fixture
def server() -> Iterator[Server]:
    made = Server()
    yield made
    made.stop()


@pytest.fixture
def kube(server: Server) -> Iterator[Kube]:
    with Kube({"host": server.url, "api_key": "secret-token"}) as made:
        yield made


def names(objects: list[Any]) -> list[str]:
    return [one["metadata"]["name"] for one in objects]


# --- credentials ----------------------------------------------------------------------------------------------------

AUTH = [
    ({}, {}, {}),
    ({"host": "https://a", "context": None}, {"K8S_AUTH_HOST": "https://b"}, {"host": "https://a"}),
    ({}, {"K8S_AUTH_HOST": "https://b", "K8S_AUTH_API_KEY": "t"}, {"host": "https://b", "api_key": "t"}),
    ({}, {"K8S_AUTH_VERIFY_SSL": "False"}, {"validate_certs": False}),
    ({}, {"K8S_AUTH_VALIDATE_CERTS": "yes"}, {"validate_certs": True}),
    ({"validate_certs": False}, {"K8S_AUTH_VERIFY_SSL": "true"}, {"validate_certs": False}),
    ({}, {"K8S_AUTH_SSL_CA_CERT": "/ca", "K8S_AUTH_CERT_FILE": "/c"}, {"ca_cert": "/ca", "client_cert": "/c"}),
    ({}, {"K8S_AUTH_IMPERSONATE_GROUPS": "a,b"}, {"impersonate_groups": ["a", "b"]}),
    ({}, {"K8S_AUTH_KUBECONFIG": ""}, {}),
]


@pytest.mark.parametrize(("params", "environ", "auth"), AUTH)
def test_options_come_before_the_environment(
    params: dict[str, Any], environ: dict[str, str], auth: dict[str, Any]
) -> None:
    assert resolve_auth(params, environ) == auth


def kubeconfig(url: str) -> dict[str, Any]:
    return {
        "apiVersion": "v1",
        "kind": "Config",
        "current-context": "lab",
        "clusters": [
            {"name": "lab", "cluster": {"server": url}},
            {"name": "away", "cluster": {"server": "http://[::1]:1"}},
        ],
        "users": [{"name": "admin", "user": {"token": "from-file"}}],
        "contexts": [
            {"name": "lab", "context": {"cluster": "lab", "user": "admin"}},
            {"name": "away", "context": {"cluster": "away", "user": "admin"}},
        ],
    }


def test_a_kubeconfig_as_file_or_as_data(server: Server, tmp_path: Path) -> None:
    path = tmp_path / "config"
    path.write_text(yaml.safe_dump(kubeconfig(server.url)))
    for given in (str(path), kubeconfig(server.url)):
        with Kube({"kubeconfig": given}) as kube:
            assert kube.objects("Pod", "robot-robot1") == []
        assert server.seen()[2]["authorization"] == "Bearer from-file"


def test_another_context_and_a_host_of_ones_own(server: Server) -> None:
    with Kube({"kubeconfig": kubeconfig(server.url), "context": "away"}) as kube:
        assert kube.host == "http://[::1]:1"
    with Kube({"kubeconfig": kubeconfig("http://127.0.0.1:1"), "host": f"{server.url}/"}) as kube:
        assert kube.nodes() == []


@pytest.mark.parametrize("content", [None, "", "{", "kind: Config"])
def test_an_unusable_kubeconfig_says_what_to_do(tmp_path: Path, content: str | None) -> None:
    path = tmp_path / "config"
    if content is not None:
        path.write_text(content)
    with pytest.raises(KubeError, match=r"No usable Kubernetes credentials in .*config.*Set kubeconfig"):
        Kube({"kubeconfig": str(path)})


# --- requests -------------------------------------------------------------------------------------------------------


def test_lists_with_selectors_and_impersonation(server: Server) -> None:
    server.lists["/apis/apps/v1/namespaces/n/deployments"] = [obj("Deployment", "a"), obj("Deployment", "b")]
    with Kube({"host": server.url, "api_key": "t", "impersonate_user": "u", "impersonate_groups": ["g", "h"]}) as kube:
        assert names(kube.objects("Deployment", "n", labels="a=b")) == ["a", "b"]
        kube.nodes()
    path, query, headers = server.seen()
    assert (path, query) == ("/apis/apps/v1/namespaces/n/deployments", {"labelSelector": "a=b"})
    assert headers["authorization"] == "Bearer t"
    assert headers["impersonate-user"] == "u"
    assert server.seen()[0] == "/api/v1/nodes"


@pytest.mark.parametrize(
    ("status", "words", "transient"),
    [
        (401, "refuses the credentials", False),
        (403, "lack that permission", False),
        (404, "Is that address a Kubernetes API", False),
        (429, "slow down", True),
        (503, "slow down", True),
    ],
)
def test_refusals(server: Server, kube: Kube, status: int, words: str, transient: bool) -> None:
    server.refusals.append((status, "slow down"))
    with pytest.raises(ApiError, match=words) as error:
        kube.nodes()
    assert server.url in str(error.value)
    assert "secret-token" not in str(error.value)
    assert (error.value.status, error.value.transient) == (status, transient)


def test_nothing_listens() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))  # bound, never listening: this port refuses for as long as the test runs
        url = f"http://127.0.0.1:{taken.getsockname()[1]}"
        with Kube({"host": url, "api_key": "t"}) as kube, pytest.raises(ApiError) as error:
            kube.nodes()
    assert str(error.value).startswith(f"The Kubernetes API at {url} cannot be reached: connection refused. Check that")
    assert error.value.transient


def test_something_else_answers(server: Server, kube: Kube) -> None:
    server.lists["/api/v1/nodes"] = None  # type: ignore[assignment] # an answer without items is an empty list
    assert kube.nodes() == []
    with pytest.raises(ApiError, match="404"):
        server.refusals.append((404, ""))
        kube.nodes()


# --- watch ----------------------------------------------------------------------------------------------------------


def take(watch: Watch, count: int) -> list[Change]:
    """The next changes; a test that waits for one that never comes ends here."""
    found: list[Change] = []
    while len(found) < count:
        new = watch.changes(10)
        assert new, f"only {[change.what for change in found]} came"
        found += new
    return found


def told(changes: list[Change]) -> list[tuple[str, list[str]]]:
    return [(change.what, names(change.objects)) for change in changes]


def test_a_list_then_what_changes(server: Server, kube: Kube) -> None:
    server.lists[PODS.path] = [obj("Pod", "a")]
    with Watch(kube, [PODS]) as watch:
        assert told(take(watch, 1)) == [("listed", ["a"])]
        assert server.next_watch()[1]["resourceVersion"] == "100"
        server.send(PODS.path, "ADDED", obj("Pod", "b"))
        server.send(PODS.path, "MODIFIED", obj("Pod", "b"))
        server.send(PODS.path, "BOOKMARK", obj("Pod", ""))
        server.send(PODS.path, "DELETED", obj("Pod", "a"))
        assert told(take(watch, 3)) == [("set", ["b"]), ("set", ["b"]), ("gone", ["a"])]


def test_several_lists_at_once(server: Server, kube: Kube) -> None:
    nodes = Target("Node")
    with Watch(kube, [PODS]) as watch:
        take(watch, 1)
        watch.follow([nodes])
        assert [(change.what, change.target) for change in take(watch, 1)] == [("listed", nodes)]
        server.send(nodes.path, "ADDED", obj("Node", "robot1"))
        server.send(PODS.path, "ADDED", obj("Pod", "a"))
        assert {change.target for change in take(watch, 2)} == {PODS, nodes}


@pytest.mark.parametrize("how", [END, CUT])
def test_a_watch_that_ends_is_resumed_where_it_stood(server: Server, kube: Kube, how: str) -> None:
    with Watch(kube, [PODS]) as watch:
        server.send(PODS.path, "ADDED", obj("Pod", "a"))  # version 101
        take(watch, 2)
        server.next_watch()
        server.send(PODS.path, how)
        assert server.next_watch()[1]["resourceVersion"] == "101"
        server.send(PODS.path, "ADDED", obj("Pod", "b"))
        assert told(take(watch, 1)) == [("set", ["b"])]


def test_410_within_the_stream_lists_again(server: Server, kube: Kube) -> None:
    with Watch(kube, [PODS]) as watch:
        take(watch, 1)
        server.lists[PODS.path] = [obj("Pod", "new")]
        server.send(PODS.path, GONE)
        assert told(take(watch, 1)) == [("listed", ["new"])]


def test_410_as_an_answer_lists_again(server: Server, kube: Kube) -> None:
    with Watch(kube, [PODS]) as watch:
        take(watch, 1)
        server.next_watch()
        server.refusals.append((410, "too old"))
        server.lists[PODS.path] = [obj("Pod", "new")]
        server.send(PODS.path, END)
        assert told(take(watch, 1)) == [("listed", ["new"])]


def test_a_server_that_is_away_for_a_while(server: Server, kube: Kube) -> None:
    server.refusals += [(503, "starting"), (500, "etcd leader changed")]
    with Watch(kube, [PODS]) as watch:
        changes = take(watch, 4)
    assert [change.what for change in changes] == ["lost", "lost", "listed", "back"]
    assert "starting" in str(changes[0].error)


@pytest.mark.parametrize("status", [401, 403])
def test_what_no_retry_mends_ends_the_stream(server: Server, kube: Kube, status: int) -> None:
    server.refusals.append((status, "go away"))
    with Watch(kube, [PODS]) as watch:
        (change,) = take(watch, 1)
    assert change.what == "refused"
    assert change.error is not None
    assert change.error.status == status


@pytest.mark.parametrize(("count", "end"), [(3, "back"), (20, "refused")])
def test_credentials_that_worked_get_some_more_chances(
    server: Server, kube: Kube, monkeypatch: pytest.MonkeyPatch, count: int, end: str
) -> None:
    monkeypatch.setattr(_watch, "FIRST_PAUSE", 0.001)
    monkeypatch.setattr(_watch, "LONGEST_PAUSE", 0.001)
    with Watch(kube, [PODS]) as watch:
        take(watch, 1)
        server.refusals += [(401, "still starting")] * count
        server.send(PODS.path, END)
        whats: list[str] = []
        while end not in whats:
            whats += [change.what for change in take(watch, 1)]
    assert whats == ["lost"] * min(count, _watch.REFUSALS_BORNE) + [end]


def test_a_broken_answer_starts_over(server: Server, kube: Kube) -> None:
    with Watch(kube, [PODS]) as watch:
        take(watch, 1)
        server.events(PODS.path).put({"unexpected": True})
        assert told(take(watch, 1)) == [("listed", [])]


def test_leaving_ends_the_threads(server: Server, kube: Kube) -> None:
    before = threading.active_count()
    with Watch(kube, [PODS, Target("Node")]) as watch:
        take(watch, 2)
        server.next_watch()
        server.next_watch()
    alive = [thread for thread in threading.enumerate() if thread.name.startswith("watch ")]
    assert alive == []
    assert threading.active_count() <= before + 3  # the server's own
