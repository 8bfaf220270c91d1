# SPDX-License-Identifier: GPL-3.0-or-later
"""The action: an account for a controller, whose token ends, and which nobody sees; and what the account may."""

from __future__ import annotations

import base64
import time
from itertools import product
from pathlib import Path
from typing import Any

import pytest
import yaml
from ansible_collections.rosops.fleet.plugins.action import _controller_access
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.cache import OF_CLUSTER, PLACES
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.parts import PARTS, ground_objects, workload_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.rights import (
    CONTROLLER,
    cluster_objects,
    controller_access,
    keeper_access,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.look import KINDS, MAPS
from ansible_collections.rosops.fleet.tests.unit.plugins.action.actions import SPACES, allows, run
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._kube.kube_server import Server
from ansible_collections.rosops.fleet.tests.unit.robots import fleet_of, robot

VARIABLES: dict[str, Any] = {
    **fleet_of(robot(), robot(name="robot2", mode="standalone")),
    "inventory_hostname": "robot1",
}
HOME = "/api/v1/namespaces/kube-system"
ACCOUNT, ENDLESS = f"{HOME}/serviceaccounts/{CONTROLLER}", f"{HOME}/secrets/{CONTROLLER}"
DAY = 86400


@pytest.fixture
def cluster(server: Server) -> Server:
    """With an account of an earlier collection, whose token has no end."""
    for name in ("kube-system", "kube-node-lease"):
        server.put(f"/api/v1/namespaces/{name}", {"metadata": {}})
    server.put(ACCOUNT, {"kind": "ServiceAccount", "metadata": {"uid": "one"}})
    server.put(ENDLESS, {"kind": "Secret", "metadata": {}, "data": {"token": "ZW5kbGVzcw=="}})
    server.put(f"{HOME}/configmaps/kube-root-ca.crt", {"metadata": {}, "data": {"ca.crt": "authority"}})
    return server


def test_its_kubeconfig_is_written_once_and_is_nobody_s_to_see(
    cluster: Server, api: dict[str, Any], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    place = tmp_path / "made" / "edge.yaml"
    arguments = {**api, "dest": str(place)}
    assert run(_controller_access, arguments, VARIABLES, check_mode=True)["changed"]
    assert not place.exists()
    assert cluster.find(ENDLESS)
    result = run(_controller_access, arguments, VARIABLES)
    assert (result["changed"], result["dest"]) == (True, str(place))
    assert place.stat().st_mode & 0o777 == 0o600
    config = yaml.safe_load(place.read_text())
    [token] = config["users"][0]["user"].values()
    authority = base64.b64encode(b"authority").decode()
    assert config["clusters"][0]["cluster"] == {"certificate-authority-data": authority, "server": cluster.url}
    assert token not in f"{result}{capsys.readouterr()}"
    assert result["ends"] == time.strftime("%Y-%m-%d", time.gmtime(_controller_access._claims(token)["exp"]))
    assert not cluster.find(ENDLESS)
    assert not run(_controller_access, arguments, VARIABLES, check_mode=True)["changed"]
    assert not run(_controller_access, arguments, VARIABLES)["changed"]
    assert token in place.read_text()


@pytest.mark.parametrize(
    ("passed", "account", "again"),
    [
        (0, "one", False),
        (59, "one", False),
        (61, "one", True),  # its last third
        (91, "one", True),
        (0, "two", True),  # somebody has taken the account away, and its tokens with it
    ],
)
def test_its_token_is_made_anew_before_it_ends(  # noqa: PLR0913 - fixtures and a row
    cluster: Server,
    api: dict[str, Any],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    passed: int,
    account: str,
    again: bool,
) -> None:
    arguments = {**api, "dest": str(tmp_path / "edge.yaml"), "days": 90}
    run(_controller_access, arguments, VARIABLES)
    before = Path(arguments["dest"]).read_text()
    now = time.time() + passed * DAY
    monkeypatch.setattr(time, "time", lambda: now)
    there = cluster.find(ACCOUNT)
    cluster.put(ACCOUNT, {**there, "metadata": {**there["metadata"], "uid": account}})
    cluster.version += 1
    for check in (True, False):
        assert run(_controller_access, arguments, VARIABLES, check_mode=check)["changed"] is again
    assert (Path(arguments["dest"]).read_text() != before) is again


@pytest.mark.parametrize("text", ["", "{", "users: [{user: {token: a.b.c}}]", "users: [{user: {token: x}}]"])
def test_a_file_that_is_no_such_kubeconfig_is_written_over(
    cluster: Server, api: dict[str, Any], tmp_path: Path, text: str
) -> None:
    (tmp_path / "edge.yaml").write_text(text)
    assert run(_controller_access, {**api, "dest": str(tmp_path / "edge.yaml")}, VARIABLES)["changed"]
    assert cluster.url in (tmp_path / "edge.yaml").read_text()


def test_it_has_rights_where_the_cluster_s_robots_are(cluster: Server, api: dict[str, Any], tmp_path: Path) -> None:
    run(_controller_access, {**api, "dest": str(tmp_path / "edge.yaml")}, VARIABLES)
    found = {path.split("/")[5] for path in cluster.lists if path.endswith("/roles") and cluster.lists[path]}
    assert found == {"robot-robot1", "kube-system", "kube-node-lease"}
    assert cluster.find("/api/v1/namespaces/robot-robot1")["metadata"]["labels"]["rosops.fleet/robot"] == "robot1"


def test_it_may_what_it_gives_the_keepers() -> None:
    """Else the API refuses their Roles."""
    rules = [rule for one in keeper_access(robot()) if one["kind"] == "Role" for rule in one["rules"]]
    given = [one for rule in rules for one in product(rule["verbs"], rule["apiGroups"], rule["resources"])]
    assert given
    assert [one for one in given if not allows(*one, "robot-robot1")] == []


def group_and_plural(kind: str) -> tuple[str, str]:
    """As a rule names it."""
    base, plural = PLACES[kind]
    return (base.split("/")[2] if base.startswith("/apis/") else ""), plural


def test_it_may_write_all_that_a_robot_is_made_of() -> None:
    """But for what is the cluster's, of which it may see whether it is as it should be."""
    secret = {"name": "pull", "registry": "r.example", "username": "u", "password": "p"}
    volumes = [{"name": "v"}]
    app = {"name": "a", "image": "e/a:1", "args": ["x"], "ports": [{"name": "web", "port": 1}], "volumes": volumes}
    more: dict[str, Any] = {"quota": {"pods": 9}, "limits": {"max": {"cpu": 1}}, "pull_secrets": [secret]}
    made = robot(app, volumes=volumes, **more)
    for one in [*ground_objects(made, PARTS, [secret], {"run.py": ""}), *workload_objects(made, PARTS)]:
        kind = one["kind"]
        group, plural = group_and_plural(kind)
        # a namespace is in itself
        space = one["metadata"].get("namespace", one["metadata"]["name"] if kind == "Namespace" else "")
        verbs = ("get",) if kind in OF_CLUSTER else ("get", "patch")
        assert [verb for verb in verbs if not allows(verb, group, plural, space)] == [], one["kind"]
    for kind in OF_CLUSTER:
        assert allows("get", *group_and_plural(kind))


def test_it_may_see_what_a_status_shows() -> None:
    for kind in KINDS:
        assert allows("list", *group_and_plural(kind)), kind
    for name, space in MAPS.items():
        assert allows("list", "", "configmaps", space, name)


EVERYWHERE = ("", "kube-system", "kube-node-lease", "default", "robot-robot9")


@pytest.mark.parametrize("space", [*EVERYWHERE, *SPACES])
def test_it_may_not_do_everything(space: str) -> None:
    rbac, admission = "rbac.authorization.k8s.io", "admissionregistration.k8s.io"
    policies = ("validatingadmissionpolicies", "validatingadmissionpolicybindings")
    never = [
        ("delete", "", "namespaces"), ("patch", "", "nodes"), ("delete", "", "secrets"), ("create", "", "pods/exec"),
        ("create", "", "serviceaccounts/token"), ("impersonate", "", "serviceaccounts"),
        *product(("escalate", "bind"), (rbac,), ("roles", "clusterroles")), ("patch", rbac, "clusterroles"),
        *product(("create", "patch", "update", "delete"), (admission,), policies),
        ("patch", "scheduling.k8s.io", "priorityclasses"),
    ]  # fmt: skip
    assert [one for one in never if allows(*one, space)] == []


@pytest.mark.parametrize("space", EVERYWHERE)
def test_outside_of_robots_namespaces_it_writes_one_map_and_sees_no_secret(space: str) -> None:
    kinds = {group_and_plural(kind) for kind in PLACES}
    verbs = ("create", "update", "patch", "delete", "deletecollection")
    assert [one for one in product(verbs, kinds) if allows(one[0], *one[1], space)] == []
    assert [verb for verb in ("get", "list", "watch") if allows(verb, "", "secrets", space)] == []
    assert allows("patch", "", "configmaps", space, "rosops-outcomes") is (space == "kube-system")
    assert not allows("patch", "", "configmaps", space, "rosops-fleet")


def test_its_token_is_in_no_secret() -> None:
    assert [one for one in [*cluster_objects(), *controller_access(SPACES)] if one["kind"] == "Secret"] == []
