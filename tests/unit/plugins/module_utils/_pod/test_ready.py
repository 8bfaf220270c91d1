# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The readiness probe, the command it runs, and what calls in a pod know of each other."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._pod import ready as ready_command
from ansible_collections.rosops.fleet.plugins.module_utils._pod import state as kept
from ansible_collections.rosops.fleet.plugins.module_utils._pod.command import run_command
from ansible_collections.rosops.fleet.tests.unit.plugins.fake_ros import Peers, read_request

SETTINGS = {"node": "/a", "expect_node": True, "command": ["ready"]}


@pytest.fixture(autouse=True)
def scratch(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(kept, "SCRATCH", str(tmp_path / "scratch"))
    return tmp_path


@pytest.fixture
def peers() -> Iterator[Peers]:
    made = Peers()
    yield made
    made.close()


# ---- asking the node


def test_the_process_id_of_a_node(peers: Peers) -> None:
    assert ready_command.process_at(peers.api("rospy", {"getPid": [1, "", 4711]})) == 4711
    assert ready_command.process_at(peers.api("closing", {"getPid": [1, "", 4711]}, keep=False)) == 4711


def test_roscpps_way_to_write_it(peers: Peers) -> None:
    """As recorded: i4 where rospy has int, a string without a type."""
    body = (
        b'<?xml version="1.0"?>\r\n<methodResponse><params><param>\r\n\t<value><array><data><value><i4>1</i4></value>'
        b"<value></value><value><i4>4711</i4></value></data></array></value>\r\n</param></params></methodResponse>\r\n"
    )

    def talk(sock: Any) -> None:
        read_request(sock)
        head = b"HTTP/1.1 200 OK\r\nServer: XMLRPC++ 0.7\r\nContent-Type: text/xml\r\nContent-length: %d\r\n\r\n"
        for part in (head % len(body), body[:50], body[50:]):
            sock.sendall(part)
            time.sleep(0.01)
        time.sleep(0.5)  # it keeps the connection

    assert ready_command.process_at(f"http://127.0.0.1:{peers.tcp(talk)}/") == 4711


@pytest.mark.parametrize("reply", [[0, "no", 0], [-1, "no", 0], [1, "", "4711"], 4711, [1, "", [1, 2]]])
def test_what_is_no_process_id(peers: Peers, reply: Any) -> None:
    with pytest.raises(ValueError):
        ready_command.process_at(peers.api("odd", {"getPid": reply}))


def test_peers_that_are_dead_hung_or_endless(peers: Peers) -> None:
    with pytest.raises(ConnectionRefusedError):
        ready_command.process_at(f"http://127.0.0.1:{peers.dead()}/")
    began = time.monotonic()
    with pytest.raises(OSError):
        ready_command.process_at(f"http://127.0.0.1:{peers.hung()}/", 0.2)
    drip = peers.tcp(lambda sock: [sock.sendall(b"x") or time.sleep(0.02) for _byte in range(500)])
    with pytest.raises(OSError):
        ready_command.process_at(f"http://127.0.0.1:{drip}/", 0.2)
    assert time.monotonic() - began < 2
    with pytest.raises(ValueError):
        ready_command.process_at(f"http://127.0.0.1:{peers.tcp(lambda sock: sock.sendall(b'x' * 100000))}/")
    with pytest.raises(ValueError):
        ready_command.process_at("nonsense")


# ---- the verdict


def unready(
    pid: int | None, state: Any = None, found: str = "", said: str = "", **settings: Any
) -> tuple[str, list[str]]:
    called: list[str] = []
    if state is not None:
        kept.save_state("/a", state)

    def ask(uri: str) -> int:
        called.append(uri)
        if pid is None:
            raise ConnectionRefusedError
        return pid

    def find(_settings: Any) -> str:
        called.append("find")
        return found

    def run(_command: list[str], _seconds: float) -> str:
        called.append("run")
        return said

    return ready_command.unready({**SETTINGS, **settings}, ask, run, find), called


KNOWN = {"uri": "http://u", "pid": 7}


def test_the_known_process_and_the_command_make_it_ready_without_a_master() -> None:
    assert unready(7, KNOWN) == ("", ["http://u", "run"])
    assert unready(7, KNOWN, said="exited with 1") == ("exited with 1", ["http://u", "run"])
    assert unready(7, KNOWN, command=None) == ("", ["http://u"])


@pytest.mark.parametrize(("pid", "state"), [(8, KNOWN), (None, KNOWN), (7, {}), (7, {"failed": "x"}), (7, None)])
def test_another_process_is_looked_for(pid: int | None, state: Any) -> None:
    assert unready(pid, state)[1][-2:] == ["find", "run"]
    reason, called = unready(pid, state, found="node /a: not registered with the master")
    assert reason == "node /a: not registered with the master"
    assert "run" not in called


def test_where_no_node_is_expected_only_the_command_counts() -> None:
    assert unready(None, expect_node=False) == ("", ["run"])


def test_main_says_why(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(
        ready_command, "load_settings", lambda _environ: {**SETTINGS, "expect_node": False, "command": ["false"]}
    )
    assert ready_command.main([]) == 1
    assert capsys.readouterr().out == "not ready: readiness.command exited with 1\n"
    monkeypatch.setattr(
        ready_command, "load_settings", lambda _environ: {**SETTINGS, "expect_node": False, "command": ["true"]}
    )
    assert ready_command.main([]) == 0
    assert capsys.readouterr().out == ""


# ---- the command


@pytest.mark.parametrize(
    ("command", "reason"),
    [
        (["true"], ""),
        (["sh", "-c", "echo fine"], ""),
        (["false"], "readiness.command exited with 1"),
        (["sh", "-c", "echo warming up; echo no fix yet >&2; exit 3"], "readiness.command exited with 3: no fix yet"),
        (["sh", "-c", "kill -9 $$"], "readiness.command was ended by signal 9"),
        (["/nowhere/ready"], "readiness.command cannot be run: /nowhere/ready: No such file or directory"),
        (["sh", "-c", "yes 2>/dev/null | head -c 300000; exit 1"], "readiness.command exited with 1: y"),
    ],
)
def test_a_commands_word(command: list[str], reason: str) -> None:
    assert run_command(command, 5.0) == reason


def test_commands_leave_no_file_open() -> None:
    files = Path("/proc/self/fd")
    before = len(list(files.iterdir()))
    for command in (["true"], ["/nowhere"], ["sh", "-c", "exit 1"]) * 10:
        run_command(command, 5.0)
    assert len(list(files.iterdir())) < before + 5


def test_a_command_that_does_not_end_is_ended_with_its_children(tmp_path: Path) -> None:
    mark = tmp_path / "mark"
    began = time.monotonic()
    script = f"(sleep 1; echo late > {mark}) & sleep 60"
    assert run_command(["sh", "-c", script], 0.2) == "readiness.command did not end within 0.2 s"
    assert time.monotonic() - began < 0.9
    time.sleep(1.1)
    assert not mark.exists()


def test_a_command_has_the_pods_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MARK", "here")
    assert run_command(["sh", "-c", '[ "$MARK" = here ]'], 5.0) == ""


def test_a_child_that_keeps_the_output_open_keeps_nobody_waiting() -> None:
    began = time.monotonic()
    assert run_command(["sh", "-c", "sleep 3 & exit 0"], 5.0) == ""
    assert time.monotonic() - began < 1


# ---- settings, contract, state

ENVIRON = {"ROSOPS_NODE_NAME": "a_0a1b2c3d", "ROSOPS_REVISION": "0a1b2c3d", "ROS_NAMESPACE": "/r1"}


def test_settings_take_the_nodes_name_from_the_pod() -> None:
    content = {
        "node": "/r1/a", "expect_node": True, "handoff": "overlap", "actions": ["~move", "/arm"],
        "min_rates": {"~status": 1, "/out": 5}, "command": None, "keeper": None, "stop_deadline": 5,
    }  # fmt: skip
    found = kept.load_settings({**ENVIRON, "ROSOPS_SETTINGS": json.dumps(content)})
    assert found["node"] == "/r1/a_0a1b2c3d"
    assert found["actions"] == ["/r1/a_0a1b2c3d/move", "/arm"]
    assert found["min_rates"] == {"/r1/a_0a1b2c3d/status": 1, "/out": 5}


@pytest.mark.parametrize("text", [None, "", "{", "[]"])
def test_without_settings_a_pod_is_still_asked_for_its_node(text: str | None) -> None:
    environ = ENVIRON if text is None else {**ENVIRON, "ROSOPS_SETTINGS": text}
    found = kept.load_settings(environ)
    assert (found["node"], found["expect_node"]) == ("/r1/a_0a1b2c3d", False)
    kept.save_state("/r1/a_0a1b2c3d", KNOWN)
    assert kept.load_settings(environ)["expect_node"] is True


@pytest.mark.parametrize(
    ("changes", "counts"),
    [
        ({}, True),
        ({"until": 99}, True),  # seconds since 1970: no clock lets a version in, whoever's it is
        ({"proven": False}, True),
        ({"proven": True}, False),
        ({"revision": "ffffffff"}, False),
        ({"revision": ""}, False),
        ({"nodes": []}, False),  # nothing was there before that answered
    ],
)
def test_a_contract_means_one_revision_until_it_is_proven(
    tmp_path: Path, changes: dict[str, Any], counts: bool
) -> None:
    contract = {"revision": "0a1b2c3d", "nodes": ["/r1/a_0a1b2c3d"], "ready_timeout": 120, "apps": ["a"], **changes}
    (tmp_path / "contract.json").write_text(json.dumps(contract))
    found = kept.load_contract(ENVIRON, str(tmp_path))
    assert found == (contract if counts else None)


@pytest.mark.parametrize("text", ["", "{}", "[]", "{"])
def test_a_contract_that_is_none(tmp_path: Path, text: str) -> None:
    (tmp_path / "contract.json").write_text(text)
    assert kept.load_contract(ENVIRON, str(tmp_path)) is None
    assert kept.load_contract(ENVIRON, str(tmp_path / "none")) is None


def test_state_is_kept_per_node_for_this_user_alone(scratch: Path) -> None:
    kept.save_state("/r1/a", {"pid": 1})
    kept.save_state("/r1/b", {"pid": 2})
    assert [kept.load_state(name) for name in ("/r1/a", "/r1/b", "/r1/c")] == [{"pid": 1}, {"pid": 2}, {}]
    assert (scratch / "scratch").stat().st_mode & 0o777 == 0o700


def test_where_nothing_can_be_written_nothing_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kept, "SCRATCH", "/proc/none")
    kept.save_state("/a", {"pid": 1})
    assert kept.load_state("/a") == {}
