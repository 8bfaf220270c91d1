# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the tokens and the configuration of k3s are written: in place, or beside it until it is exchanged."""

from __future__ import annotations

from typing import Any

import pytest
from ansible.template import trust_as_template
from ansible_collections.rosops.fleet.plugins.action import _k3s_files
from ansible_collections.rosops.fleet.tests.unit.plugins.action.actions import run

CONFIG, UNIT, REGISTRIES = (
    "/etc/rancher/k3s/config.yaml", "/etc/systemd/system/k3s.service", "/etc/rancher/k3s/registries.yaml",
)  # fmt: skip
PLAN: dict[str, Any] = {"tokens": [], "etcd": False}


@pytest.fixture
def written(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, bool]]:
    """What is written or removed, and whether it is only looked at."""
    done: list[tuple[str, bool]] = []

    def write(host: Any, path: str, _content: str, _mode: str, diff: bool) -> dict[str, Any]:
        done.append((path, host.check_mode))
        return {"changed": True, "diff": [{"before": "", "after": path}] if diff else []}

    def module(host: Any, name: str, args: dict[str, Any]) -> dict[str, Any]:
        assert name == "ansible.builtin.file"
        done.append((args["path"], host.check_mode))
        return {"changed": True}

    monkeypatch.setattr(_k3s_files.ActionHost, "write", write)
    monkeypatch.setattr(_k3s_files.ActionHost, "module", module)
    return done


def files(staged: str, check_mode: bool = False, joins: str = "", **more: Any) -> dict[str, Any]:
    """Those of a server, or of an agent that joins one."""
    server = "edge1" if joins else "robot1"
    variables = {
        "hostvars": {"robot1": {}, "edge1": {}}, "k3s_role": "agent" if joins else "server", "k3s_cluster": "edge",
        "k3s_server_hosts": [server], "k3s_node_name": "robot1", "k3s_kubeconfig_path": "",
    }  # fmt: skip
    plan = {"write": [CONFIG, UNIT], "remove": [REGISTRIES], "staged": staged, "joins": joins, **PLAN, **more}
    return run(_k3s_files, {"plan": plan, "registered": "__k3s_slurped"}, variables, check_mode)


def test_in_place(written: list[tuple[str, bool]]) -> None:
    assert files("")["changed"]
    assert written == [(CONFIG, False), (UNIT, False), (REGISTRIES, False)]


def test_tokens_come_in_place_and_what_they_are_not_shown(written: list[tuple[str, bool]]) -> None:
    found = files(".next", tokens=["token"])
    assert written[0] == ("/etc/rancher/k3s/token", False)
    assert "/etc/rancher/k3s/token" not in str(found["diff"])
    written.clear()
    files("", check_mode=True, tokens=["agent-token"])
    assert written[0] == ("/etc/rancher/k3s/agent-token", True)


def test_what_works_is_only_compared_and_what_comes_lies_beside_it(written: list[tuple[str, bool]]) -> None:
    assert files(".next")["changed"]
    assert written == [
        (CONFIG, True), (f"{CONFIG}.next", False), (UNIT, True), (f"{UNIT}.next", False), (REGISTRIES, True),
    ]  # fmt: skip


def test_check_mode_writes_nowhere(written: list[tuple[str, bool]]) -> None:
    assert files(".next", check_mode=True)["changed"]
    assert written == [(CONFIG, True), (UNIT, True), (REGISTRIES, True)]


def test_a_server_to_join_comes_with_ansibles_tags(written: list[tuple[str, bool]]) -> None:
    """As every text does that another task returned."""
    assert not files("", joins=trust_as_template("https://edge1:6443")).get("failed")
    assert written


def test_a_server_that_has_etcd_keeps_it(monkeypatch: pytest.MonkeyPatch) -> None:
    texts: dict[str, str] = {}

    def write(_host: Any, path: str, content: str, _mode: str, diff: bool) -> dict[str, Any]:
        return {"changed": bool(texts.setdefault(path, content)) and diff}

    monkeypatch.setattr(_k3s_files.ActionHost, "write", write)
    known = {
        "hostvars": {"robot1": {}}, "k3s_role": "server", "k3s_cluster": "robot1", "k3s_server_hosts": ["robot1"],
        "k3s_node_name": "robot1", "k3s_kubeconfig_path": "",
    }  # fmt: skip
    for etcd in (False, True):
        texts.clear()
        plan = {**PLAN, "write": [CONFIG], "remove": [], "etcd": etcd, "joins": "", "staged": ""}
        run(_k3s_files, {"plan": plan, "registered": ""}, known, False)
        assert ("cluster-init: true" in texts[CONFIG]) is etcd
