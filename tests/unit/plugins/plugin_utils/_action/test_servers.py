# SPDX-License-Identifier: GPL-3.0-or-later
"""The servers' token: who has which, and another one, which is on no command line and in no log."""

from __future__ import annotations

from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import KubeError
from ansible_collections.rosops.fleet.plugins.plugin_utils._action import servers

THREE = ["edge1", "edge2", "edge3"]
KEPT, RUNS = "/etc/rancher/k3s/token", "/var/lib/rancher/k3s/server/token"
HASH = "a" * 64


def whole(password: str) -> str:
    return f"K10{HASH}::server:{password}"


class Cluster:
    """Three servers' files. k3s on the first writes its new token into its own file, and nothing else."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.files = {server: {KEPT: whole("old"), RUNS: whole("old")} for server in THREE}
        self.files["edge1"][KEPT] = "old"  # as the first server has it
        self.asked: list[str] = []
        self.away, self.leaves = "", ""  # the second one as soon as there is another token
        monkeypatch.setattr(servers.ansible_core, "run_task", self.run)

    def run(self, _action: Any, _known: Any, task: dict[str, Any]) -> dict[str, Any]:
        assert task["no_log"] and task["become"] and task["check_mode"] is False
        server = task["delegate_to"]
        files = self.files[server]
        if server == self.away:
            return {"unreachable": True, "msg": "no route"}
        if copy := task.get("ansible.builtin.copy"):
            assert copy["mode"] == "0600"
            self.asked.append(f"{server}: write {copy['dest']}")
            files[copy["dest"]] = copy["content"]
            return {"changed": True}
        words = " ".join(task["ansible.builtin.command"]["argv"])
        self.asked.append(f"{server}: {words}")
        if words == "/usr/local/bin/k3s token rotate":
            files[RUNS] = whole("new")
            self.away = self.leaves
            return {"stdout": "Token rotated, restart k3s nodes with new token"}
        if words.startswith("cp -p "):
            files[f"{KEPT}.previous"] = files[KEPT]
            return {"stdout": ""}
        wanted = [name for name in (KEPT, RUNS) if name in words.split()]
        return {"stdout": "\n".join(files[name].strip() for name in wanted if name in files)}

    def read(self) -> servers.SharedToken:
        return servers.shared_token(None, {}, THREE)


@pytest.fixture
def cluster(monkeypatch: pytest.MonkeyPatch) -> Cluster:
    return Cluster(monkeypatch)


def test_both_forms_of_a_token_are_the_same_one(cluster: Cluster) -> None:
    found = cluster.read()
    assert (found.newest, found.agreed, {*found.kept.values()}) == ("old", True, {"old"})


def test_another_one_is_on_all_servers_at_once_and_on_no_command_line(cluster: Cluster) -> None:
    servers.rotate_token(None, {}, THREE)
    assert cluster.asked[3] == "edge1: /usr/local/bin/k3s token rotate"
    assert not [line for line in cluster.asked if "old" in line or "new" in line]
    assert {files[KEPT] for files in cluster.files.values()} == {f"{whole('new')}\n"}
    # snapshots of before need it
    assert cluster.files["edge1"][f"{KEPT}.previous"] == "old"
    found = cluster.read()
    assert (found.newest, found.agreed) == ("new", False)  # two of them have not started with it
    for name in ("edge2", "edge3"):
        cluster.files[name][RUNS] = whole("new")
    assert cluster.read().agreed


def test_a_server_that_did_not_get_it_or_has_none_is_known(cluster: Cluster) -> None:
    cluster.away = "edge3"
    with pytest.raises(KubeError, match="no route"):
        servers.rotate_token(None, {}, THREE)
    assert "token rotate" not in " ".join(cluster.asked)  # it is not begun without one of them
    cluster.leaves = "edge3"
    cluster.away = ""
    with pytest.raises(KubeError, match="no route"):
        servers.rotate_token(None, {}, THREE)
    with pytest.raises(KubeError, match="the servers' token cannot be read on edge3: no route"):
        cluster.read()
    cluster.away = ""
    found = cluster.read()
    assert (found.newest, found.agreed, found.kept) == ("new", False, {"edge1": "new", "edge2": "new", "edge3": "old"})
    del cluster.files["edge2"][RUNS]
    with pytest.raises(KubeError, match="cannot be read on edge2"):
        cluster.read()
