# SPDX-License-Identifier: GPL-3.0-or-later
"""What the role k3s is told to do on a host that it has looked at."""

from __future__ import annotations

import hashlib
import subprocess
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest
from ansible_collections.rosops.fleet.plugins.action import _k3s_plan
from ansible_collections.rosops.fleet.plugins.module_utils._host.k3s import BINARY
from ansible_collections.rosops.fleet.plugins.plugin_utils._action.servers import SharedToken
from ansible_collections.rosops.fleet.plugins.plugin_utils._k3s.wanted import Wanted, wanted
from ansible_collections.rosops.fleet.tests.unit.plugins.action.actions import k3s_of, run

HOSTVARS: dict[str, dict[str, str]] = {"edge1": {"ansible_host": "10.0.0.1"}, "edge2": {}, "edge3": {}, "robot1": {}}
GONE = {"exists": False, "sha256": "", "mode": ""}
BARE: dict[str, Any] = {
    "machine": "x86_64", "version": "", "images": {},
    "service": {"active": "inactive", "enabled": False, "installed": False}, "other_service": False,
    "stale": False, "ready": False, "data": False, "lapsed": False, "etcd": False, "encrypts": False,
    "cgroup_refused": False,
    "tokens": {"server": "absent", "agent": "absent"}, "server_url": "", "answering": [],
    "foreign": [], "change": {"unproven": False, "version": "", "renewed": False}, "kubeconfig_sha256": "",
}  # fmt: skip


class Planned:
    """The plan for a host of which the module says `now`, and what was asked for it."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.check_mode, self.ends = False, "pass"
        self.servers: dict[str, dict[str, Any]] = {"edge1": {"stdout": "yes"}}
        self.asked: dict[str, Any] = {}  # of the module
        self.waited, self.servers_asked = list[float](), list[str]()
        monkeypatch.setattr(_k3s_plan.ActionHost, "job", lambda _host, *asked: self.job(*asked))
        monkeypatch.setattr(_k3s_plan.ansible_core, "run_task", self.on_a_server)

    def __call__(self, host: str, now: dict[str, Any], rotate: str = "", **variables: Any) -> dict[str, Any]:
        self.now = now
        given = {**k3s_of(host, "edge1", "edge2", "edge3", hostvars=HOSTVARS), **variables}
        return run(_k3s_plan, {"rotate": rotate}, given, self.check_mode)

    def job(self, name: str, args: dict[str, Any], secrets: Any = None) -> dict[str, Any]:
        if name == "k3s_ready":
            self.waited.append(args["timeout"])
            seen = {"observed": "/readyz: etcd failed", "elapsed": 300.2, "verdict": self.ends}
            return {**seen, "failed": self.ends != "pass"}
        assert name == "k3s_facts"
        assert secrets in ({"token": "", "agent_token": ""}, {"token": "of mine", "agent_token": ""})
        self.asked = args
        return {"files": dict.fromkeys([*args["files"], *args["beside"], BINARY], GONE), **BARE, **self.now}

    def on_a_server(self, _action: Any, _known: Any, task: dict[str, Any]) -> dict[str, Any]:
        assert (task["become"], task["check_mode"]) == (True, False)
        assert task["ansible.builtin.command"]["argv"][:2] == ["sh", "-c"]
        self.servers_asked.append(task["delegate_to"])
        return self.servers[task["delegate_to"]]


@pytest.fixture
def planned(monkeypatch: pytest.MonkeyPatch) -> Planned:
    return Planned(monkeypatch)


UP: dict[str, Any] = {
    "service": {**BARE["service"], "active": "active", "enabled": True, "installed": True},
    "data": True,
    "tokens": {"server": "same", "agent": "same"},
    "version": "v1.34.1+k3s1",
}


def test_a_bare_host_is_installed_in_place(planned: Planned) -> None:
    found = planned("edge1", {})
    assert (found["any"], found["guarded"], found["staged"], found["binary"]) == (True, False, "", True)
    assert (found["state"], found["rivals"], found["join"]) == ("started", ["edge2", "edge3"], [])
    assert planned.asked["servers"] == []


def test_one_that_works_is_staged(planned: Planned) -> None:
    found = planned("edge1", {**UP, "ready": True})
    assert (found["guarded"], found["staged"], found["restart"], found["version"]) == (
        True, ".next", True, "v1.34.1+k3s1",
    )  # fmt: skip


def test_a_new_member_asks_the_servers_that_live(planned: Planned) -> None:
    """The first server is away: whoever has the cluster takes the member in."""
    found = planned("robot1", {"answering": ["edge2:6443", "edge3:6443"]})
    assert planned.asked["servers"] == ["10.0.0.1:6443", "edge2:6443", "edge3:6443"]
    assert (found["givers"], found["joins"]) == (["edge2", "edge3"], "https://edge2:6443")
    assert (found["tokens"], found["join"]) == (["agent-token"], [])  # its own is made for it
    planned("edge2", {})
    assert planned.asked["servers"] == ["10.0.0.1:6443", "edge3:6443"]  # and not itself
    # where none answers the first is named
    assert [planned(host, {})["givers"] for host in ("robot1", "edge2")] == [["edge1"], ["edge1"]]


def test_an_agent_joins_anew_by_its_name(planned: Planned) -> None:
    """The token that the inventory has for agents is none of its own."""
    sound = {**UP, "ready": True, "version": "v1.34.2+k3s1"}
    for named, tokens in (("", []), ("robot2, robot1", ["agent-token"]), ("robot2", [])):
        found = planned("robot1", sound, k3s_enrol=named, k3s_agent_token="any")  # noqa: S106 - nobody's
        assert found["tokens"] == tokens


@pytest.mark.parametrize(("etcd", "init"), [(False, False), (True, True)])
def test_the_configuration_goes_by_the_datastore_that_the_host_has(
    planned: Planned, monkeypatch: pytest.MonkeyPatch, etcd: bool, init: bool
) -> None:
    plan = Mock(return_value={"tokens": [], "guarded": False, "unsure": False, "any": False, "rotate": ""})
    monkeypatch.setattr(_k3s_plan, "plan", plan)
    found = planned("edge1", {"etcd": etcd}, k3s_server_hosts=["edge1"])
    assert ("cluster-init: true" in plan.call_args.args[1].files[0].content) is init
    assert found["etcd"] is etcd


def test_a_new_cluster_encrypts_and_one_that_is_there_does_as_it_did(planned: Planned) -> None:
    assert planned("edge1", {})["encrypts"] is True
    assert planned("edge1", {**UP, "ready": True})["encrypts"] is False
    assert planned("edge1", {**UP, "ready": True, "encrypts": True})["encrypts"] is True
    # nobody knows here whether that is new
    assert planned("edge1", {}, k3s_config={"datastore-endpoint": "postgres://x"})["encrypts"] is False
    assert planned.asked["external"] is True
    assert planned("robot1", {})["encrypts"] is False
    assert not planned.servers_asked


CONFIG, UNIT = "/etc/rancher/k3s/config.yaml", "/etc/systemd/system/k3s.service"
SYSCTLS, AUDIT_POLICY = "/etc/sysctl.d/90-rosops-fleet.conf", "/etc/rancher/k3s/rosops-fleet-audit.yaml"


@pytest.mark.parametrize("encrypts", [False, True])
def test_hardening_comes_and_goes_as_a_change_of_a_cluster_that_works(
    planned: Planned, monkeypatch: pytest.MonkeyPatch, encrypts: bool
) -> None:
    """What began without encryption stays so, and is not started again for what new clusters have."""
    parts: list[Wanted] = []

    def recorded(*given: Any) -> Wanted:
        parts.append(wanted(*given))
        return parts[-1]

    def there() -> dict[str, Any]:
        """As it is once the last plan was carried out."""
        written = {file.path: file for file in (*parts[-1].files, *parts[-1].beside) if file.content}
        return {"files": dict.fromkeys(planned.asked["files"], GONE) | {BINARY: {**GONE, "mode": "0755"}} | {
            path: {"exists": True, "mode": file.mode, "sha256": hashlib.sha256(file.content.encode()).hexdigest()}
            for path, file in written.items()
        }}  # fmt: skip

    monkeypatch.setattr(_k3s_plan, "wanted", recorded)
    works = {**UP, "ready": True, "version": "v1.34.2+k3s1", "encrypts": encrypts}
    planned("edge1", works)
    assert ("secrets-encryption: true" in parts[-1].files[0].content) is encrypts
    before = there()
    again = planned("edge1", {**works, **before})
    assert (again["any"], again["write"], again["remove"]) == (False, [], [])
    comes = planned("edge1", {**works, **before}, k3s_hardening=True)
    assert (comes["guarded"], comes["staged"], comes["remove"]) == (True, ".next", [])
    assert sorted(comes["write"]) == sorted([CONFIG, UNIT, SYSCTLS, AUDIT_POLICY])
    hardened = there()
    assert planned("edge1", {**works, **hardened}, k3s_hardening=True)["any"] is False
    goes = planned("edge1", {**works, **hardened})
    assert (goes["guarded"], sorted(goes["write"])) == (True, sorted([CONFIG, UNIT]))
    assert sorted(goes["remove"]) == sorted([SYSCTLS, AUDIT_POLICY])


def test_a_server_that_joins_asks_one_of_its_cluster(planned: Planned) -> None:
    for said in ("yes", "no"):
        planned.servers = {"edge1": {"unreachable": True, "msg": "no route"}, "edge3": {"stdout": said}}
        found = planned("edge2", {"answering": ["10.0.0.1:6443", "edge3:6443"]})
        assert found["encrypts"] is (said == "yes")
    assert planned.servers_asked == ["edge1", "edge3"] * 2
    planned.servers = {"edge1": {"failed": True, "msg": "away"}}  # who cannot be asked is not joined either
    assert planned("edge2", {})["encrypts"] is False


@pytest.mark.parametrize(("there", "said"), [
    ((), "yes"),  # it is still to come, and will
    (("server/db",), "no"),
    (("server/db", "server/cred/encryption-config.json"), "yes"),
])  # fmt: skip
def test_what_a_server_answers(tmp_path: Path, there: tuple[str, ...], said: str) -> None:
    for name in there:
        (tmp_path / name).mkdir(parents=True)
    script = _k3s_plan.ENCRYPTS.replace("/var/lib/rancher/k3s", str(tmp_path))
    assert subprocess.run(["sh", "-c", script], check=True, capture_output=True, text=True).stdout.strip() == said  # noqa: S603, S607


def test_an_older_version_is_refused(planned: Planned) -> None:
    found = planned("edge1", {"version": "v1.99.0+k3s1"})
    assert found["failed"]
    assert "edge1 was left as it is." in found["msg"]
    assert "is older than v1.99.0+k3s1" in found["msg"]


def test_one_slow_answer_makes_no_k3s_that_does_not_work(planned: Planned) -> None:
    found = planned("edge1", UP, k3s_start_timeout=300)
    assert (found["guarded"], found["staged"], found["works"]) == (True, ".next", True)
    assert planned.waited == [300]


def test_one_that_is_up_and_never_serves_is_left_alone(planned: Planned) -> None:
    """What it has started may be at work."""
    planned.ends = "wait"
    found = planned("edge1", UP)
    assert found["failed"]
    assert "edge1 was left as it is. Its k3s is up and does not serve: /readyz: etcd failed, for 300 s" in found["msg"]
    forced = planned("edge1", UP, update_on_busy="force")
    assert (forced["any"], forced["guarded"]) == (True, False)


@pytest.mark.parametrize(("active", "waited"), [("active", [300]), ("failed", [])])
def test_one_that_keeps_ending_or_is_down_is_mended_and_that_is_said(
    planned: Planned, capsys: pytest.CaptureFixture[str], active: str, waited: list[float]
) -> None:
    planned.ends = "fail"
    found = planned("edge1", {**UP, "service": {**UP["service"], "active": active}})
    assert (found["any"], found["guarded"], planned.waited) == (True, False, waited)
    assert "whatever works here cannot be asked" in capsys.readouterr().out


def test_what_nobody_has_proven_is_waited_for_and_never_refused(planned: Planned) -> None:
    unproven = {**UP, "change": {"unproven": True, "version": "v1.34.1+k3s1", "renewed": False}}
    assert planned("edge1", unproven)["works"]
    planned.ends = "wait"
    found = planned("edge1", unproven)
    assert (found["guarded"], found["works"]) == (True, False)


# --- certificates and the servers' token are made anew ----------------------------------------------------------------

SERVES: dict[str, Any] = {**UP, "ready": True, "version": "v1.34.2+k3s1"}


def cut_off(**change: bool) -> dict[str, Any]:
    return {**SERVES, "change": {"unproven": True, "version": "v1.34.2+k3s1", "renewed": False, **change}}


@pytest.mark.parametrize(("host", "tokens"), [("edge1", []), ("edge2", []), ("robot1", ["agent-token"])])
def test_certificates_are_made_anew_each_time(planned: Planned, host: str, tokens: list[str]) -> None:
    """An agent's token has ended long ago, and without its certificate it would not be let in."""
    found = planned(host, SERVES, rotate="certificates")
    assert (found["rotate"], found["guarded"], found["restart"]) == ("certificates", True, True)
    assert (found["tokens"], found["undone"]) == (tokens, planned(host, SERVES)["undone"])
    assert not planned.servers_asked


@pytest.mark.parametrize("host", ["edge1", "robot1"])
def test_certificates_that_were_made_and_not_proven_are_not_made_again(planned: Planned, host: str) -> None:
    found = planned(host, cut_off(renewed=True), rotate="certificates", k3s_version="v1.34.2+k3s1")
    assert (found["rotate"], found["guarded"], found["tokens"]) == ("", True, [])
    stopped = {**cut_off(renewed=True), "ready": False, "service": {**UP["service"], "active": "inactive"}}
    found = planned(host, stopped, rotate="certificates")
    assert (found["rotate"], found["restart"]) == ("certificates", True)  # the host knows that they are new
    assert planned(host, cut_off(), rotate="certificates")["rotate"] == "certificates"


@pytest.mark.parametrize("now", [{}, {**SERVES, "ready": False, "service": {**UP["service"], "active": "failed"}}])
def test_where_no_k3s_serves_nothing_is_rotated(planned: Planned, now: dict[str, Any]) -> None:
    found = planned("edge1", now, rotate="certificates")
    assert found["failed"]
    assert "edge1 was left as it is. No k3s serves here whose certificates could be rotated" in found["msg"]


@pytest.fixture
def shared(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """What the servers say of their token."""
    said: dict[str, Any] = {"newest": "a", "kept": dict.fromkeys(HOSTVARS, "a"), "agreed": True}
    monkeypatch.setattr(_k3s_plan, "shared_token", lambda *_given: SharedToken(**said))
    return said


ROTATE: dict[str, Any] = {"rotate": "token", "ansible_play_hosts_all": ["edge1", "edge2", "edge3", "robot1"]}
DIFFERS = {**SERVES, "tokens": {"server": "differs", "agent": "same"}}


@pytest.mark.usefixtures("shared")
def test_the_first_server_has_a_new_token_made(planned: Planned) -> None:
    found = planned("edge1", SERVES, **ROTATE)
    assert (found["rotate"], found["guarded"], found["tokens"]) == ("token", True, [])
    assert (planned("edge2", SERVES, **ROTATE)["rotate"], planned("robot1", SERVES, **ROTATE)["rotate"]) == ("", "")
    planned.check_mode = True  # in which the first one does nothing that the others could see
    assert planned("edge2", SERVES, **ROTATE)["rotate"] == "token"


@pytest.mark.usefixtures("shared")
@pytest.mark.parametrize(("more", "words"), [
    ({"k3s_token": "of mine"}, "k3s itself makes the new token. Take k3s_token out of the inventory"),
    ({"ansible_play_hosts_all": ["edge1", "edge3"]}, "in one run. edge2 is not in it"),
])  # fmt: skip
def test_a_token_is_not_begun_where_it_cannot_be_ended(planned: Planned, more: dict[str, Any], words: str) -> None:
    found = planned("edge1", SERVES, **ROTATE | more)
    assert found["failed"]
    assert words in found["msg"]


def test_a_token_whose_rotation_was_cut_off_is_no_third_one(planned: Planned, shared: dict[str, Any]) -> None:
    """Server 1 is done; 2 has it and has not started with it; 3 was away."""
    shared.update(newest="b", agreed=False, kept={"edge1": "b", "edge2": "b", "edge3": "a"})
    done = planned("edge1", SERVES, **ROTATE)
    assert (done["rotate"], done["tokens"], done["restart"]) == ("", [], planned("edge1", SERVES)["restart"])
    has = planned("edge2", {**DIFFERS, "stale": True}, **ROTATE)
    assert (has["rotate"], has["tokens"], has["guarded"]) == ("", [], True)
    away = planned("edge3", SERVES, **ROTATE)
    assert (away["tokens"], away["join"], away["givers"], away["undone"]) == (["token"], ["token"], ["edge1"], True)


def test_the_first_server_takes_what_its_k3s_has_made(planned: Planned, shared: dict[str, Any]) -> None:
    shared.update(newest="b", agreed=False)
    found = planned("edge1", DIFFERS, **ROTATE)
    assert (found["rotate"], found["tokens"], found["givers"]) == ("", ["token"], ["edge1"])
    # only who asks for a rotation
    assert "rosops.fleet.rotate with rotate=token goes on with it" in planned("edge1", DIFFERS)["msg"]


@pytest.mark.usefixtures("shared")
def test_a_start_with_a_new_token_that_nobody_has_proven_is_proven(planned: Planned) -> None:
    assert planned("edge1", cut_off(), **ROTATE)["rotate"] == ""
