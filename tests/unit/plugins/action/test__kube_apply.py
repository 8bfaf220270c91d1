# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The action: objects in, result and diff out."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.action import _kube_apply
from ansible_collections.rosops.fleet.tests.unit.plugins.action.actions import run
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._kube.kube_server import Server

NAMESPACE = {"apiVersion": "v1", "kind": "Namespace", "metadata": {"name": "n"}}
MAP = {"apiVersion": "v1", "kind": "ConfigMap", "metadata": {"name": "m", "namespace": "n"}, "data": {"k": "v"}}
BOTH = [NAMESPACE, MAP]


def test_applies_once(api: dict[str, Any]) -> None:
    first = run(_kube_apply, {**api, "objects": BOTH}, {})
    assert first["changed"]
    assert [one["before_header"] for one in first["diff"]] == ["Namespace n", "ConfigMap n/m"]
    assert first["results"][1] == {"kind": "ConfigMap", "name": "m", "namespace": "n", "changed": True}
    again = run(_kube_apply, {**api, "objects": BOTH}, {})
    assert (again["changed"], again["diff"]) == (False, [])


def test_check_mode_writes_nothing(server: Server, api: dict[str, Any]) -> None:
    assert run(_kube_apply, {**api, "objects": BOTH}, {}, check_mode=True)["changed"]
    assert not server.find("/api/v1/namespaces/n")


def test_deletes(server: Server, api: dict[str, Any]) -> None:
    run(_kube_apply, {**api, "objects": BOTH}, {})
    gone = {**api, "objects": [MAP], "state": "absent"}
    assert run(_kube_apply, gone, {}, check_mode=True)["changed"]
    assert [run(_kube_apply, gone, {})["changed"] for _ in range(2)] == [True, False]
    assert not server.find("/api/v1/namespaces/n/configmaps/m")


@pytest.mark.parametrize(("state", "names"), [("present", "Namespace n\nConfigMap n/m\n"), ("absent", "")])
def test_without_a_cluster_check_mode_names_what_would_be_there(tmp_path: Path, state: str, names: str) -> None:
    args = {"kubeconfig": str(tmp_path / "edge.yaml"), "objects": BOTH, "state": state}
    foreseen = run(_kube_apply, args, {}, check_mode=True)
    assert (foreseen["changed"], foreseen["diff"]["after"]) == (bool(names), names)
    refused = run(_kube_apply, args, {})
    assert refused["failed"]
    assert "The stage k3s of rosops.fleet.site writes it" in refused["msg"]


def test_a_refusal_fails_the_task(server: Server, api: dict[str, Any]) -> None:
    server.write_refusals += [(422, "no")]
    failed = run(_kube_apply, {**api, "objects": BOTH}, {})
    assert (failed["failed"], failed["applied"]) == (True, [])
