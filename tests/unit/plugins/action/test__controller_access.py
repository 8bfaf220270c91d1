# SPDX-License-Identifier: GPL-3.0-or-later
"""The action: an account for a controller, whose token nobody sees."""

from __future__ import annotations

import base64
from itertools import product
from pathlib import Path
from typing import Any

import pytest
import yaml
from ansible_collections.rosops.fleet.plugins.action import _controller_access
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.cache import OF_CLUSTER, PLACES
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.rights import CONTROLLER, keeper_access
from ansible_collections.rosops.fleet.tests.unit.plugins.action.actions import allows, run
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._kube.kube_server import Server
from ansible_collections.rosops.fleet.tests.unit.robots import fleet_of, robot

VARIABLES: dict[str, Any] = {**fleet_of(robot()), "inventory_hostname": "robot1"}
SECRET = f"/api/v1/namespaces/kube-system/secrets/{CONTROLLER}"


def test_its_kubeconfig_is_written_once_and_is_nobody_s_to_see(
    server: Server, api: dict[str, Any], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    server.put("/api/v1/namespaces/kube-system", {"metadata": {}})
    data = {"token": base64.b64encode(b"hush").decode(), "ca.crt": base64.b64encode(b"authority").decode()}
    server.put(SECRET, {"kind": "Secret", "metadata": {"name": CONTROLLER, "namespace": "kube-system"}, "data": data})
    place = tmp_path / "made" / "edge.yaml"
    arguments = {**api, "dest": str(place)}
    assert run(_controller_access, arguments, VARIABLES, check_mode=True)["changed"]
    assert not place.exists()
    result = run(_controller_access, arguments, VARIABLES)
    assert (result["changed"], result["dest"]) == (True, str(place))
    assert place.stat().st_mode & 0o777 == 0o600
    config = yaml.safe_load(place.read_text())
    assert config["users"][0]["user"] == {"token": "hush"}
    assert config["clusters"][0]["cluster"] == {"certificate-authority-data": data["ca.crt"], "server": server.url}
    assert "hush" not in f"{result}{capsys.readouterr()}"
    assert data["token"] not in str(result)
    assert not run(_controller_access, arguments, VARIABLES)["changed"]


def test_it_may_what_it_gives_the_keepers() -> None:
    """Else the API refuses their Roles."""
    rules = [rule for one in keeper_access(robot()) if one["kind"] == "Role" for rule in one["rules"]]
    given = [one for rule in rules for one in product(rule["verbs"], rule["apiGroups"], rule["resources"])]
    assert given
    assert [one for one in given if not allows(*one)] == []


def test_it_may_see_what_is_the_cluster_s() -> None:
    """Else no run with it could tell whether that is as it should be."""
    for base, plural in (PLACES[kind] for kind in OF_CLUSTER):
        assert allows("get", base.split("/")[2], plural)


@pytest.mark.parametrize(
    ("verb", "group", "resource"),
    [
        ("delete", "", "namespaces"),
        ("patch", "", "nodes"),
        ("delete", "", "secrets"),
        ("create", "", "pods/exec"),
        *product(
            ("create", "patch", "update", "delete"),
            ("admissionregistration.k8s.io",),
            ("validatingadmissionpolicies", "validatingadmissionpolicybindings"),
        ),
        ("patch", "rbac.authorization.k8s.io", "clusterroles"),
    ],
)
def test_it_may_not_do_everything(verb: str, group: str, resource: str) -> None:
    assert not allows(verb, group, resource)
