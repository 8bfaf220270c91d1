# SPDX-License-Identifier: GPL-3.0-or-later
"""What the host is asked to do, where files are written; the kubeconfig goes with its cluster, and only with that."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from ansible.template import trust_as_template
from ansible_collections.rosops.fleet.plugins.action import _k3s_host
from ansible_collections.rosops.fleet.plugins.plugin_utils._action import servers
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.kubeconfig import kubeconfig_head
from ansible_collections.rosops.fleet.tests.unit.plugins.action.actions import k3s_of, run

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
    known = k3s_of("edge1", "edge1", k3s_start_timeout="20", k3s_environment=PROXY)
    run(_k3s_host, {"do": do, "plan": plan}, known, False)
    assert asked == [(*job, False)]


def forget(path: Path, host: str = "edge1", check_mode: bool = False, **variables: Any) -> dict[str, Any]:
    given = {"hostvars": {"edge1": {"ansible_host": "10.0.0.1"}, "edge2": {}}, "k3s_kubeconfig_path": str(path)}
    given |= {"ansible_play_hosts_all": ["edge1", "edge2"], **variables}
    return run(_k3s_host, {"do": "remove"}, k3s_of(host, "edge1", "edge2", **given), check_mode)


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


# --- tokens and configuration, in place or beside it until it is exchanged --------------------------------------------

CONFIG, UNIT, REGISTRIES = (
    "/etc/rancher/k3s/config.yaml", "/etc/systemd/system/k3s.service", "/etc/rancher/k3s/registries.yaml",
)  # fmt: skip
PLAN: dict[str, Any] = {"tokens": [], "beside": [], "etcd": False, "encrypts": False}


@pytest.fixture
def written(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, bool]]:
    """What is written or removed, and whether it is only looked at."""
    done: list[tuple[str, bool]] = []

    def write(host: Any, path: str, _content: str, _mode: str, diff: bool) -> dict[str, Any]:
        done.append((path, host.check_mode))
        return {"changed": True, "diff": [{"before": "", "after": path}] if diff else []}

    def module(host: Any, name: str, args: dict[str, Any]) -> dict[str, Any]:
        done.append((" ".join(args["argv"]) if name == "ansible.builtin.command" else args["path"], host.check_mode))
        return {"changed": True}

    monkeypatch.setattr(_k3s_host.ActionHost, "write", write)
    monkeypatch.setattr(_k3s_host.ActionHost, "module", module)
    return done


def files(staged: str, check_mode: bool = False, joins: str = "", **more: Any) -> dict[str, Any]:
    """Those of a server, or of an agent that joins one."""
    variables = k3s_of("robot1", "edge1" if joins else "robot1", hostvars={"robot1": {}, "edge1": {}})
    plan = {**PLAN, "write": [CONFIG, UNIT], "remove": [REGISTRIES], "staged": staged, "joins": joins, **more}
    return run(_k3s_host, {"do": "files", "plan": plan, "registered": "__k3s_slurped"}, variables, check_mode)


def test_in_place(written: list[tuple[str, bool]]) -> None:
    assert files("")["changed"]
    assert written == [(CONFIG, False), (UNIT, False), (REGISTRIES, False)]
    assert files("", write=[CONFIG, REGISTRIES])["diff"] == [{"before": "", "after": CONFIG}]  # the other has passwords


def test_tokens_come_in_place_and_what_they_are_not_shown(written: list[tuple[str, bool]]) -> None:
    found = files(".next", tokens=["token"])
    assert written[0] == ("/etc/rancher/k3s/token", False)
    assert "/etc/rancher/k3s/token" not in str(found["diff"])
    written.clear()
    files("", check_mode=True, tokens=["agent-token"])
    assert written[0] == ("/etc/rancher/k3s/agent-token", True)
    # a robot that goes on working keeps the token for agents that it has, and nothing is to be started again
    written.clear()
    files(".next", tokens=["agent-token"], write=[], remove=[])
    assert written == [("/etc/rancher/k3s/agent-token.next", False)]


def test_what_works_is_only_compared_and_what_comes_lies_beside_it(written: list[tuple[str, bool]]) -> None:
    assert files(".next")["changed"]
    assert written == [
        (CONFIG, True), (f"{CONFIG}.next", False), (UNIT, True), (f"{UNIT}.next", False), (REGISTRIES, True),
    ]  # fmt: skip
    written.clear()
    assert files(".next", check_mode=True)["changed"]
    assert written == [(CONFIG, True), (UNIT, True), (REGISTRIES, True)]


def test_what_k3s_does_not_read_comes_in_place_and_at_once(written: list[tuple[str, bool]]) -> None:
    file = "/etc/sysctl.d/90-rosops-fleet-cni0.conf"
    at_once = "/lib/systemd/systemd-sysctl --prefix=/net/ipv4/neigh/cni0"
    for staged in ("", ".next"):
        written.clear()
        assert files(staged, write=[], remove=[], beside=[file])["changed"]
        assert written == [(file, False), (at_once, False)]
    written.clear()
    assert files("", check_mode=True, write=[], remove=[], beside=[file])["changed"]
    assert written == [(file, True)]


def test_a_server_to_join_comes_with_ansibles_tags(written: list[tuple[str, bool]]) -> None:
    """As every text does that another task returned."""
    assert not files("", joins=trust_as_template("https://edge1:6443")).get("failed")
    assert written


def test_a_server_keeps_the_datastore_that_it_has(monkeypatch: pytest.MonkeyPatch) -> None:
    texts: dict[str, str] = {}

    def write(_host: Any, path: str, content: str, _mode: str, diff: bool) -> dict[str, Any]:
        return {"changed": bool(texts.setdefault(path, content)) and diff}

    monkeypatch.setattr(_k3s_host.ActionHost, "write", write)
    known = k3s_of("robot1", "robot1", hostvars={"robot1": {}})
    for etcd, encrypts in ((False, True), (True, False)):
        texts.clear()
        there = {"etcd": etcd, "encrypts": encrypts}
        plan = {**PLAN, "write": [CONFIG], "remove": [], "joins": "", "staged": "", **there}
        run(_k3s_host, {"do": "files", "plan": plan, "registered": ""}, known, False)
        assert ("cluster-init: true" in texts[CONFIG]) is etcd
        assert ("secrets-encryption: true" in texts[CONFIG]) is encrypts


# --- a token for one agent alone --------------------------------------------------------------------------------------

MADE = f"K10{'a' * 64}::abcdef.0123456789abcdef"
AGENT = k3s_of("robot1", "edge1", "edge2", hostvars={"robot1": {}, "edge1": {}, "edge2": {}})
AGENT |= {"k3s_node_name": "robot-one", "k3s_agent_token": "of the servers"}
REVOKED = "rosops-fleet-revoked-robot-one"
POLICIES = f"validatingadmissionpolicybinding,validatingadmissionpolicy {REVOKED} --ignore-not-found"


class Servers:
    """What k3s on the servers answers, by the first words of what is asked; and what was asked of which."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, **answers: dict[str, Any]) -> None:
        self.answers, self.asked = answers, list[str]()
        self.wrote: dict[str, str] = {}
        monkeypatch.setattr(servers.ansible_core, "run_task", self.run)
        monkeypatch.setattr(_k3s_host.ActionHost, "write", self.write)

    def run(self, _action: Any, _known: Any, task: dict[str, Any]) -> dict[str, Any]:
        _binary, *said = task["ansible.builtin.command"]["argv"]
        assert task["no_log"] and task["become"] and task["check_mode"] is False
        self.asked.append(f"{task['delegate_to']}: {' '.join(said)}")
        return self.answers.get(task["delegate_to"], {}) or self.answers.get(said[1], {"stdout": ""})

    def write(self, path: str, content: str, _mode: str, diff: bool) -> dict[str, Any]:
        assert not diff
        self.wrote[path] = content
        return {"changed": True}

    def join(self, check_mode: bool = False, **variables: Any) -> dict[str, Any]:
        plan = {
            **PLAN,
            "tokens": ["agent-token"],
            "write": [],
            "remove": [],
            "staged": "",
            "joins": "https://edge1:6443",
        }
        given = {"do": "files", "plan": {**plan, "givers": ["edge1", "edge2"]}}
        return run(_k3s_host, given, {**AGENT, **variables}, check_mode)


CREATED = {"create": {"stdout": f"{MADE}\n"}}


def test_an_agent_gets_a_token_that_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first server is away; what it says of that is no secret's place."""
    asked_of = Servers(monkeypatch, edge1={"unreachable": True, "msg": "no route"}, **CREATED)
    assert asked_of.join(check_mode=True)["changed"]
    assert not asked_of.asked
    assert asked_of.join()["changed"]
    assert asked_of.wrote == {"/etc/rancher/k3s/agent-token": f"{MADE}\n"}
    assert asked_of.asked[1:] == [
        f"edge2: kubectl get {POLICIES} -o name",
        "edge2: token create --ttl 1h --description rosops.fleet: robot-one",
    ]


def test_where_no_server_makes_one_that_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    away, broken = {"unreachable": True, "msg": "no route"}, {"failed": True, "stderr": MADE}
    asked_of = Servers(monkeypatch, edge1=away, edge2=broken)
    said = asked_of.join()
    assert said["failed"]
    assert "robot1 has not joined the cluster edge yet" in said["msg"]
    assert "edge1: no route; edge2: ********" in said["msg"]
    assert not asked_of.wrote


def test_one_that_was_revoked_gets_one_by_its_name_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    asked_of = Servers(monkeypatch, get={"stdout": f"validatingadmissionpolicy/{REVOKED}"}, **CREATED)
    said = asked_of.join()
    assert said["failed"]
    assert "robot1 gets no token: the node robot-one is revoked" in said["msg"]
    assert not any("token create" in one for one in asked_of.asked)
    assert asked_of.join(k3s_enrol="robot1")["changed"]
    assert asked_of.asked[-2] == f"edge1: kubectl delete {POLICIES}"
    assert asked_of.wrote == {"/etc/rancher/k3s/agent-token": f"{MADE}\n"}
