# SPDX-License-Identifier: GPL-3.0-or-later
"""The way to a cluster: given, or fetched once from one of its servers."""

from __future__ import annotations

from pathlib import Path
from types import MappingProxyType
from typing import Any

import pytest
import yaml
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import FleetError, KubeError
from ansible_collections.rosops.fleet.plugins.plugin_utils._action.access import AWAY_SECONDS, Fetch, Way, given_way
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.access import NoClusterError, ServersAwayError
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.kubeconfig import kubeconfig_head
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.fleet import Home
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.topology import ClusterPart

HOME = Home(ClusterPart("agent", "edge", ("edge1", "edge2", "edge3"), False, "robot1"), "production")
HOSTVARS = {"edge1": {"ansible_host": "10.0.0.1"}, "edge2": {"ansible_host": "2001:db8::2"}, "edge3": {}}
ADMIN = "clusters: [{cluster: {server: 'https://127.0.0.1:6444'}}]\nusers: [{user: {token: t}}]\n"
ENVIRONMENT = {"K8S_AUTH_HOST": "https://staging", "K8S_AUTH_API_KEY": "t"}


# --- given ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("params", "environ", "source"), [
    ({"kubeconfig": "/k"}, ENVIRONMENT, "the task's options"),
    ({"kubeconfig": ""}, ENVIRONMENT, "K8S_AUTH_HOST of the environment"),
    ({}, {"K8S_AUTH_KUBECONFIG": "/k", "K8S_AUTH_CONTEXT": "c"}, "K8S_AUTH_KUBECONFIG and K8S_AUTH_CONTEXT of the "),
    ({"context": "c"}, {}, "the task's options"),
    ({"validate_certs": False}, {"K8S_AUTH_API_KEY": "t", "K8S_AUTH_HOST": ""}, ""),  # which says no API
])  # fmt: skip
def test_what_is_given_for_the_shared_cluster(params: dict[str, Any], environ: dict[str, str], source: str) -> None:
    way = given_way(params, "", environ, "edge")
    assert bool(way) == bool(source)
    assert not way or (way.source.startswith(source), way.environment, way.own) == (True, True, False)


def test_the_environment_holds_one_access_and_a_standalone_robot_has_its_own(tmp_path: Path) -> None:
    assert given_way({}, "", ENVIRONMENT, "robot2") is None
    path = tmp_path / "robot2.yaml"
    assert given_way({}, str(path), ENVIRONMENT, "robot2") is None  # not there: fetched
    path.write_text(f"{kubeconfig_head('', 'https://robot2:6443', 'robot2')}\napiVersion: v1\n")
    assert given_way({}, str(path), ENVIRONMENT, "robot2") is None  # a run's own, for kubectl
    path.write_text("apiVersion: v1\n")
    way = given_way({}, str(path), ENVIRONMENT, "robot2")
    assert way and (way.options, way.environment) == ({"kubeconfig": str(path)}, False)
    way = given_way({"kubeconfig": "/mine"}, "", ENVIRONMENT, "robot2")
    assert way and way.environment is False


# --- fetched --------------------------------------------------------------------------------------------------------


class Servers:
    """The k3s.yaml of each server, or what is raised instead."""

    def __init__(self, **texts: str | FleetError) -> None:
        self.texts, self.asked, self.serving = texts, list[str](), {"10.0.0.1", "2001:db8::2", "edge3"}

    def read(self, server: str) -> str:
        self.asked.append(server)
        found = self.texts.get(server, ADMIN)
        if isinstance(found, FleetError):
            raise found
        return found

    def accepts(self, host: str, port: int) -> bool:
        assert port == 6444  # as the server's own file says
        return host in self.serving

    def fetch(self, directory: Path, **more: Any) -> Fetch:
        return Fetch(directory, **{"read": self.read, "accepts": self.accepts, **more})

    def way(self, directory: Path, hostvars: Any = HOSTVARS, options: Any = MappingProxyType({}), **more: Any) -> Way:
        return self.fetch(directory, **more).way(HOME, hostvars, options)


def server_of(way: Any) -> str:
    path = Path(way.options["kubeconfig"])
    assert path.stat().st_mode & 0o777 == 0o600
    return str(yaml.safe_load(path.read_text())["clusters"][0]["cluster"]["server"])


def test_it_is_fetched_from_the_first_server_and_once(tmp_path: Path) -> None:
    servers = Servers()
    way = servers.way(tmp_path, options={"validate_certs": True})
    assert server_of(way) == "https://10.0.0.1:6444"
    assert (way.own, way.environment, way.options["validate_certs"]) == (True, False, True)
    assert servers.way(tmp_path).options["kubeconfig"] == way.options["kubeconfig"]
    assert servers.asked == ["edge1"]
    servers.fetch(tmp_path).forget("edge")
    servers.way(tmp_path)
    assert servers.asked == ["edge1"] * 2


def test_a_hiccup_puts_off_nobody_and_is_told(tmp_path: Path) -> None:
    servers, told = Servers(), list[str]()
    hiccups = [ServersAwayError("Connection reset by peer") for _server in HOME.part.servers]

    def read(server: str) -> str:
        text = servers.read(server)
        if hiccups:
            raise hiccups.pop()
        return text

    assert server_of(servers.way(tmp_path, read=read, say=told.append)) == "https://10.0.0.1:6444"
    assert servers.asked == ["edge1", "edge2", "edge3", "edge1"]
    assert told == [
        f"the cluster edge gives no access on its server {server}: Connection reset by peer"
        for server in ("edge1", "edge2", "edge3")
    ]


def test_a_server_whose_file_has_no_credentials_keeps_nobody_from_the_others(tmp_path: Path) -> None:
    bare = ADMIN.replace("token: t", "exec: {command: x}")
    told: list[str] = []
    assert server_of(Servers(edge1=bare).way(tmp_path, say=told.append)) == "https://[2001:db8::2]:6444"
    assert "edge1: the server's k3s.yaml has neither " in told[0]


def test_any_living_server_will_do_and_one_whose_k3s_is_down_where_there_is_no_other(tmp_path: Path) -> None:
    servers = Servers(edge1=ServersAwayError("no route"))
    servers.serving = {"edge3"}
    assert server_of(servers.way(tmp_path)) == "https://edge3:6444"
    servers.serving = set()
    servers.fetch(tmp_path).forget("edge")
    assert server_of(servers.way(tmp_path)) == "https://[2001:db8::2]:6444"  # it may be back in a moment
    assert servers.asked == ["edge1", "edge2", "edge3"] * 2


@pytest.mark.parametrize(
    ("front", "place"),
    [("api.example.org", "api.example.org"), ("fd00::5", "[fd00::5]"), ("[fd00::5]", "[fd00::5]")],
)
def test_what_stands_in_front_of_the_servers(tmp_path: Path, front: str, place: str) -> None:
    hostvars = {host: {**own, "k3s_api_endpoint": front} for host, own in HOSTVARS.items()}
    way = Servers().way(tmp_path, hostvars, accepts=lambda *_: True)
    assert server_of(way) == f"https://{place}:6444"


@pytest.mark.parametrize(
    ("each", "kind", "said"),
    [
        (ServersAwayError("no route"), ServersAwayError, "No server of the cluster edge can be reached over SSH"),
        (NoClusterError("it has no k3s.yaml"), NoClusterError, "There is no cluster edge yet"),
        (KubeError("sudo: a password is required"), KubeError, "There is no access to the cluster edge: edge1: sudo"),
    ],
)
def test_without_any_server_it_says_what_each_of_them_said(
    tmp_path: Path, each: FleetError, kind: type[FleetError], said: str
) -> None:
    servers = Servers(edge1=each, edge2=each, edge3=each)
    now = [100.0]
    fetch = servers.fetch(tmp_path, wall=lambda: now[0])
    for _robot in range(3):  # the second and the third of the cluster's robots do not wait for it again
        with pytest.raises(kind, match=said) as error:
            fetch.way(HOME, HOSTVARS, {})
        assert error.type is kind
        assert all(f"{server}: {each}" in str(error.value) for server in HOME.part.servers)
    assert servers.asked == ["edge1", "edge2", "edge3"] * (1 if kind is NoClusterError else 2)
    servers.texts.clear()
    now[0] += AWAY_SECONDS
    assert fetch.way(HOME, HOSTVARS, {}).own


def test_a_server_that_is_away_is_no_server_without_k3s(tmp_path: Path) -> None:
    none = NoClusterError("no k3s")
    with pytest.raises(KubeError) as error:
        Servers(edge1=ServersAwayError("no route"), edge2=none, edge3=none).way(tmp_path)
    assert error.type is KubeError
