# SPDX-License-Identifier: GPL-3.0-or-later
"""What the host is asked to do; and the kubeconfig on the control node goes with its cluster, and only with that."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.action import _k3s_host
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.kubeconfig import kubeconfig_head
from ansible_collections.rosops.fleet.tests.unit.plugins.action.actions import run

OURS = kubeconfig_head("0" * 64, "https://10.0.0.1:6443", "edge")


@pytest.fixture(autouse=True)
def asked(monkeypatch: pytest.MonkeyPatch) -> list[tuple[Any, ...]]:
    """Of a host on which nothing is left; each with whether it is only looked at."""
    asked: list[tuple[Any, ...]] = []

    def job(host: Any, name: str, arguments: dict[str, Any], secrets: Any = None) -> dict[str, Any]:
        asked.append((name, arguments | (secrets or {}), host.check_mode))
        return {"changed": False, "removed": {}}

    monkeypatch.setattr(_k3s_host.ActionHost, "job", job)
    return asked


SOURCE = {"url": "https://x/k3s", "sha256": "", "sums": "https://x/sums", "path": ""}
PROXY = {"HTTPS_PROXY": "http://proxy:3128"}


@pytest.mark.parametrize(
    ("do", "plan", "job"),
    [
        ("ready", {"member": "edge1"}, ("k3s_ready", {"role": "server", "timeout": 20.0, "member": "edge1"})),
        ("ready", {}, ("k3s_ready", {"role": "server", "timeout": 20.0, "member": ""})),
        ("download", {"source": SOURCE, "staged": ".next"}, ("k3s_download", {
            "url": "https://x/k3s", "sha256": "", "sums": "https://x/sums", "dest": "/usr/local/bin/k3s.next",
            "environment": PROXY,
        })),
    ],
)  # fmt: skip
def test_what_the_plan_says(
    asked: list[tuple[Any, ...]], do: str, plan: dict[str, Any], job: tuple[str, dict[str, Any]]
) -> None:
    known = {"k3s_cluster": "edge", "k3s_role": "server", "k3s_server_hosts": ["edge1"], "k3s_start_timeout": "20"}
    run(_k3s_host, {"do": do, "plan": plan}, {**known, "k3s_environment": PROXY}, False)
    assert asked == [(*job, False)]


def forget(path: Path, host: str = "edge1", check_mode: bool = False, **variables: Any) -> dict[str, Any]:
    given = {
        "inventory_hostname": host, "hostvars": {"edge1": {"ansible_host": "10.0.0.1"}, "edge2": {}},
        "k3s_cluster": "edge", "k3s_role": "server", "k3s_server_hosts": ["edge1", "edge2"],
        "k3s_node_name": host, "k3s_kubeconfig_path": str(path),
        "ansible_play_hosts_all": ["edge1", "edge2"], **variables,
    }  # fmt: skip
    return run(_k3s_host, {"do": "remove"}, given, check_mode)


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


def test_it_stays_while_another_server_goes_on_with_the_cluster(tmp_path: Path) -> None:
    path = tmp_path / "edge.yaml"
    path.write_text(f"{OURS}\na: 1\n")
    assert forget(path, ansible_play_hosts_all=["edge1"]) == {"changed": False, "removed": {}}
    assert path.exists()


@pytest.mark.parametrize("check_mode", [False, True])
def test_volumes_and_identity_stay_unless_asked_for(
    tmp_path: Path, asked: list[tuple[Any, ...]], check_mode: bool
) -> None:
    """A text of -e is no yes."""
    forget(tmp_path / "none", check_mode=check_mode)
    forget(tmp_path / "none", k3s_remove_volumes="false", k3s_remove_identity="true")
    assert [(name, *given.values()) for name, given, _check in asked] == [
        ("k3s_remove", False, False), ("k3s_remove", False, True),
    ]  # fmt: skip
    assert [check for _name, _given, check in asked] == [check_mode, False]
