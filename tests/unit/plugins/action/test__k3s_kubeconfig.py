# SPDX-License-Identifier: GPL-3.0-or-later
"""The kubeconfig on the control node goes with its cluster, and only with that."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.action import _k3s_kubeconfig
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.kubeconfig import kubeconfig_head
from ansible_collections.rosops.fleet.tests.unit.plugins.action.actions import run

OURS = kubeconfig_head("0" * 64, "https://10.0.0.1:6443", "edge")


def forget(path: Path, host: str = "edge1", check_mode: bool = False, **variables: Any) -> dict[str, Any]:
    given = {
        "inventory_hostname": host, "hostvars": {"edge1": {"ansible_host": "10.0.0.1"}, "edge2": {}},
        "k3s_cluster": "edge", "k3s_role": "server", "k3s_server_hosts": ["edge1", "edge2"],
        "k3s_node_name": host, "k3s_kubeconfig_path": str(path), **variables,
    }  # fmt: skip
    return run(_k3s_kubeconfig, {"state": "absent"}, given, check_mode)


def test_it_goes_once(tmp_path: Path) -> None:
    path = tmp_path / "edge.yaml"
    path.write_text(f"{OURS}\na: 1\n")
    assert forget(path, check_mode=True)["changed"]
    assert not forget(path, "edge2")["changed"]  # the first server's
    assert path.exists()
    assert [forget(path)["changed"] for _run in range(2)] == [True, False]
    assert not path.exists()


@pytest.mark.parametrize(
    "head",
    [
        "apiVersion: v1",
        kubeconfig_head("0" * 64, "https://10.0.0.9:6443", "edge"),  # another fleet's
        kubeconfig_head("0" * 64, "https://10.0.0.1:6443", "robot1"),
    ],
)
def test_another_clusters_stays(tmp_path: Path, head: str) -> None:
    path = tmp_path / "config"
    path.write_text(f"{head}\na: 1\n")
    found = forget(path)
    assert not found["changed"]
    assert "was not written for the cluster edge and stays" in found["msg"]
    assert path.exists()
