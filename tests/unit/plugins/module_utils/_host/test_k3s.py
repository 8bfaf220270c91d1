# SPDX-License-Identifier: GPL-3.0-or-later
"""Tokens, unit states, readiness and the binary of k3s, without k3s."""

from __future__ import annotations

import hashlib
import io
import json
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import FleetError
from ansible_collections.rosops.fleet.plugins.module_utils._host import k3s as _k3s
from ansible_collections.rosops.fleet.plugins.module_utils._host.k3s import K3sHost, fetch, listed_sum, proxies

HASH = "a" * 64
FULL = f"K10{HASH}::server:s3cret"
ACTIVE = {"LoadState": "loaded", "ActiveState": "active", "SubState": "running", "NRestarts": "0"}


@pytest.mark.parametrize(("given", "kept", "cluster", "verdict"), [
    ("", "", "", "absent"), ("s3cret", "", "", "absent"), ("", "s3cret\n", FULL, "same"),
    ("s3cret", "s3cret\n", FULL, "same"), ("s3cret", FULL, "", "same"),
    ("with:colons", f"K10{HASH}::node:with:colons", "", "same"), ("y", "K10short::x:y", "", "differs"),
    (FULL, "s3cret", FULL, "same"), ("other", "s3cret", FULL, "differs"), ("other", "s3cret", "", "differs"),
    ("other", "", FULL, "differs"), ("", "other", FULL, "differs"), ("s3cret", "", FULL, "restore"),
    ("", "", FULL, "lost"), ("", f"K10{HASH}::abcdef.0123456789abcdef", "", "same"),
])  # fmt: skip
def test_given_tokens_against_the_running_one(given: str, kept: str, cluster: str, verdict: str) -> None:
    assert _k3s.token_verdict(given, kept, cluster) == verdict


@pytest.mark.parametrize(
    "text",
    [
        f'level=error msg="token {FULL} is bad"',
        "starting with --token=s3cret",
        'config: {"token": "s3cret"}',
        "K3S_TOKEN=s3cret1",
        "etcd-s3-secret-key: s3cret-key",
        "my s3cret in a line",
        # forms that are known whatever the secret is
        "dial https://robot:s3cret1@proxy.example.org:3128: refused",
        "tailscale up --authkey x: joinKey=s3cret1,controlServerURL=https://a",
        "k3s agent --token s3cret1 --server https://edge1:6443",
        "request: Authorization: Bearer s3cret1",
        "cannot reach http://me:s3cret1@proxy:3128/",
        '{"authorization":"Basic s3cret1"}',
        "MQTT_PASS=s3cret1",
        'wifi: {"psk": "s3cret1"}',
        "broker me:s3cret1@mqtt refused",
    ],
)
@pytest.mark.parametrize("known", [["s3cret\n"], []])
def test_no_secret_gets_into_a_message(text: str, known: list[str]) -> None:
    if known or "s3cret1" in text:
        assert "s3cret" not in _k3s.without_secrets(text, known)


@pytest.mark.parametrize(
    "line",
    [
        'time="2026-11-21" level=fatal msg="starting kubernetes: address already in use"',
        "pulled docker.io/talker:v1.2.3@sha256:0123456789",
        "bypass=whatever it is, at 10:30:11",
    ],
)
def test_ordinary_lines_stay_as_they_are(line: str) -> None:
    assert _k3s.without_secrets(line, ["", "s3cret"]) == line


def test_version() -> None:
    assert _k3s.version_of("k3s version v1.34.2+k3s1 (deadbee)\ngo version go1.24.9") == "v1.34.2+k3s1"
    assert _k3s.version_of("not k3s") == ""


def test_a_binary_that_does_not_run_has_no_version(tmp_path: Path) -> None:
    """The module goes on, and the plan brings another one."""
    (tmp_path / "k3s").write_text("")
    run = Mock(side_effect=OSError(8, "Exec format error"))
    assert K3sHost(run, str(tmp_path)).version("/k3s") == ""
    run.assert_called_once_with([f"{tmp_path}/k3s", "--version"], handle_exceptions=False)
    assert K3sHost(run).api("/readyz") == (False, "[Errno 8] Exec format error")


class Commands:
    """Answers by the words of a command."""

    def __init__(self, answers: dict[str, tuple[int, str, str]]) -> None:
        self.answers = answers

    def __call__(self, command: list[str], **_options: Any) -> tuple[int, str, str]:
        line = " ".join(command)
        return next((answer for part, answer in self.answers.items() if part in line), (1, "", "unexpected"))


def systemctl(**changes: str) -> tuple[int, str, str]:
    return 0, "\n".join(f"{key}={value}" for key, value in {**ACTIVE, **changes}.items()), ""


UP = {"show k3s": systemctl(), "/readyz": (0, "ok", "")}


def node(**condition: str) -> dict[str, tuple[int, str, str]]:
    return {**UP, "/nodes/edge2": (0, json.dumps({"status": {"conditions": [condition] if condition else []}}), "")}


def agent(**changes: str) -> dict[str, tuple[int, str, str]]:
    return {"show k3s-agent": systemctl(**changes)}


@pytest.mark.parametrize(
    ("role", "answers", "verdict", "observed"),
    [
        ("agent", agent(), "pass", "the unit is active (running)"),  # without a word to the server
        ("agent", agent(NRestarts="7"), "pass", "the unit is active (running)"),
        ("agent", agent(ActiveState="activating", SubState="start"), "wait", "the unit is activating (start)"),
        ("server", {"show k3s": systemctl(ActiveState="failed", Result="exit-code")}, "fail",
         "the unit failed: exit-code"),
        ("agent", agent(NRestarts="9", Result="exit-code"), "fail",
         "the unit keeps ending: started 4 times again, last result exit-code"),
        ("agent", agent(LoadState="not-found"), "fail", "the unit is not-found"),
        ("agent", {"show k3s-agent": (0, "", "")}, "fail", "the unit is unknown"),
        ("server", {**UP, "/readyz": (1, "", "connection refused")}, "wait", "/readyz: connection refused"),
        ("server", UP, "pass", "the unit is active (running)"),
        ("edge2", {**UP, "/nodes/edge2": (1, "", "not found")}, "wait", "Node edge2: not found"),
        ("edge2", node(type="EtcdIsVoter", status="True"), "pass", "etcd member has a vote"),
        ("edge2", node(type="EtcdIsVoter", status="False", message="it learns"), "wait",
         "etcd member has no vote yet: it learns"),
        ("edge2", node(type="Ready", status="False"), "pass", "etcd member has a vote"),
        ("edge2", node(), "pass", "etcd member has a vote"),  # another datastore
    ],
)  # fmt: skip
def test_what_is_ready(role: str, answers: dict[str, tuple[int, str, str]], verdict: str, observed: str) -> None:
    """A server that shares its datastore has a name, and is to have a vote."""
    member = role if role == "edge2" else ""
    seen = K3sHost(Commands(answers)).look("server" if member else role, member, restarts_before=5)
    assert (seen.verdict, seen.observed) == (verdict, observed)


def test_stale_compares_with_what_the_unit_wrote_down(tmp_path: Path) -> None:
    names = ["/etc/rancher/k3s/config.yaml", "/etc/rancher/k3s/registries.yaml"]
    stat = Commands(
        {"stat -c %n %i %s %Y /etc/rancher/k3s/config.yaml": (1, f"{names[0]} 7 5 1700000000\n", "no such")}
    )
    host = K3sHost(stat, str(tmp_path))
    assert host.stale("k3s", names)  # nothing written down: nothing is known
    record = tmp_path / "run/rosops-fleet-k3s.started"
    record.parent.mkdir()
    record.write_text(f"{names[0]} 7 5 1700000000\n")
    assert not host.stale("k3s", names)
    record.write_text(f"{names[0]} 8 5 1700000000\n")
    assert host.stale("k3s", names)


def test_files_are_described_and_missing_ones_too(tmp_path: Path) -> None:
    (tmp_path / "x").write_text("abc")
    (tmp_path / "x").chmod(0o600)
    host = K3sHost(Commands({}), str(tmp_path))
    assert host.describe("/x") == {
        "exists": True,
        "sha256": "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad",
        "mode": "0600",
    }
    assert host.describe("/y") == {"exists": False, "sha256": "", "mode": ""}
    assert host.sizes("/nowhere") == {}
    assert host.version() == ""


def test_the_journal_comes_with_what_matters_and_without_secrets(tmp_path: Path) -> None:
    (tmp_path / "etc/rancher/k3s").mkdir(parents=True)
    (tmp_path / "etc/rancher/k3s/token").write_text("s3cret\n")
    wrong = 'time="2026-11-21" level=fatal msg="flag provided but not defined: -nodename'
    journal = [f'{wrong} {FULL} s3cret"', "I1121 04:06:58 all is well", '{"level":"warn","msg":"slow"}', "x" * 999]

    def said(*lines: str) -> str:
        return K3sHost(Commands({"journalctl": (0, "\n".join(lines), "")}), str(tmp_path)).journal("k3s", 2, 0)

    assert said(*journal) == f'{wrong} ******** ********"'
    assert said(*journal[1:]) == f"{journal[2]}\n{'x' * 300}"
    (tmp_path / "etc/rancher/k3s/agent-token").write_text(f"K10{HASH}::abcdef.0123456789abcdef\n")
    assert said(f"{wrong} abcdef.0123456789abcdef") == f"{wrong} ********"


# --- its binary -------------------------------------------------------------------------------------------------------

BINARY = b"k3s" * 1000
SUM = hashlib.sha256(BINARY).hexdigest()


def test_it_comes_whole_and_once(tmp_path: Path) -> None:
    network, place = Mock(return_value=io.BytesIO(BINARY)), tmp_path / "k3s"
    assert [fetch(network, "https://x/k3s", place, SUM) for _time in range(2)] == [True, False]
    assert (place.read_bytes(), place.stat().st_mode & 0o777) == (BINARY, 0o755)
    network.assert_called_once_with("https://x/k3s")
    assert [path.name for path in tmp_path.iterdir()] == ["k3s"]


def test_it_comes_again_where_it_cannot_be_run(tmp_path: Path) -> None:
    place = tmp_path / "k3s"
    place.write_bytes(BINARY)
    assert fetch(Mock(return_value=io.BytesIO(BINARY)), "https://x/k3s", place, SUM)
    assert place.stat().st_mode & 0o777 == 0o755


@pytest.mark.parametrize(("answer", "told"), [
    (io.BytesIO(b"something else"), f"expected is {SUM}"),
    (Mock(read=io.BytesIO(BINARY[:9]).read, length=2991), "it broke off, and 2991 bytes are missing"),
])  # fmt: skip
def test_what_is_not_what_it_should_be_does_not_come(tmp_path: Path, answer: Any, told: str) -> None:
    place = tmp_path / "k3s"
    place.write_text("the one before")
    with pytest.raises(FleetError, match=told):
        fetch(lambda _url: answer, "https://x/k3s", place, SUM)
    assert place.read_text() == "the one before"
    assert [path.name for path in tmp_path.iterdir()] == ["k3s"]


def test_a_list_of_sums() -> None:
    text = f"{'0' * 64}  k3s-arm64\n{SUM}  k3s\n"
    assert listed_sum(text, "k3s", "https://x/sums") == SUM
    with pytest.raises(FleetError, match="https://x/sums has no SHA-256 of k3s-armhf"):
        listed_sum(text, "k3s-armhf", "https://x/sums")


def test_proxies_out_of_the_units_environment() -> None:
    proxy = "http://me:s3cret@proxy:3128"
    found = proxies({"HTTPS_PROXY": proxy, "no_proxy": "10.0.0.0/8", "K3S_DEBUG": True, "ALL_PROXY": None})
    assert found == {
        "https_proxy": proxy, "HTTPS_PROXY": proxy, "no_proxy": "10.0.0.0/8", "NO_PROXY": "10.0.0.0/8",
    }  # fmt: skip
