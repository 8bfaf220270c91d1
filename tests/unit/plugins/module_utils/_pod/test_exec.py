# SPDX-License-Identifier: GPL-3.0-or-later
from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._pod import exec as exec_command
from ansible_collections.rosops.fleet.tests.unit.plugins.fake_ros import Peers, until

CODE = Path(exec_command.__file__).read_text("utf-8")


@pytest.mark.parametrize(
    ("uri", "address"),
    [
        ("http://ros-master:11311", ("ros-master", 11311)),
        ("http://ros-master.fleet:11311/", ("ros-master.fleet", 11311)),
        ("http://[fd00::1]:11311/", ("fd00::1", 11311)),
    ],
)
def test_the_masters_address(uri: str, address: tuple[str, int]) -> None:
    assert exec_command.address_of({"ROS_MASTER_URI": uri}) == address


def test_a_master_that_is_away_is_not_waited_for_for_ever(peers: Peers) -> None:
    began = time.monotonic()
    assert not exec_command.reachable(("127.0.0.1", peers.dead()), 0.3)
    assert 0.3 <= time.monotonic() - began < 5


def test_each_attempt_has_a_port_of_its_own_that_no_other_connection_gets() -> None:
    """A host that did not know the Service yet would lead a later connection from the same port nowhere."""
    ephemeral = int(Path("/proc/sys/net/ipv4/ip_local_port_range").read_text("utf-8").split()[0])
    with socket.create_server(("127.0.0.1", 0)) as master:
        ports = []
        for _attempt in range(3):
            assert exec_command.reachable(master.getsockname())
            peer, (_host, port) = master.accept()
            peer.close()
            ports.append(port)
            time.sleep(exec_command.PAUSE)
    assert len(set(ports)) == 3
    assert max(ports) < min(30000, ephemeral)


def started(tmp_path: Path, port: int, *command: str) -> subprocess.Popen[str]:
    script = tmp_path / "exec.py"
    script.write_text(CODE + "\nraise SystemExit(main(sys.argv[1:]))\n")
    return subprocess.Popen(  # noqa: S603 - our own
        [sys.executable, "-I", "-S", str(script), *command],
        env={"ROS_MASTER_URI": f"http://127.0.0.1:{port}", "PATH": os.environ["PATH"], "KEPT": "yes"},
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip


def test_the_command_begins_when_the_master_listens(tmp_path: Path) -> None:
    """It is the very process, has its environment, and dies of SIGPIPE as programs that Python did not start do."""
    with socket.socket() as master:
        master.bind(("127.0.0.1", 0))
        process = started(tmp_path, master.getsockname()[1], "sh", "-c", "echo $$ $KEPT; grep SigIgn /proc/$$/status")
        time.sleep(0.4)
        assert process.poll() is None, "it did not wait"
        master.listen()
        out, _err = process.communicate(timeout=20)
    words = out.split()
    assert words[:2] == [str(process.pid), "yes"]
    assert int(words[-1], 16) & (1 << 12) == 0, "SIGPIPE is ignored"


def test_who_waits_can_be_stopped(tmp_path: Path, peers: Peers) -> None:
    """The first process of a container is deaf to signals that it does not ask for."""
    process = started(tmp_path, peers.dead(), "true")
    until(lambda: caught(process.pid, signal.SIGTERM))
    process.terminate()
    assert process.wait(timeout=20) == 143


def caught(pid: int, number: int) -> bool:
    status = Path(f"/proc/{pid}/status").read_text("utf-8")
    mask = next(line.split()[1] for line in status.splitlines() if line.startswith("SigCgt"))
    return bool(int(mask, 16) & (1 << (number - 1)))


def test_without_a_command_it_ends_when_one_could_begin(tmp_path: Path, peers: Peers) -> None:
    assert started(tmp_path, peers.hung()).wait(timeout=20) == 0


@pytest.mark.parametrize(
    ("command", "code", "why"), [("/nowhere/node", 127, "No such file or directory"), ("/", 126, "Permission denied")]
)
def test_a_command_that_cannot_be_started(tmp_path: Path, peers: Peers, command: str, code: int, why: str) -> None:
    process = started(tmp_path, peers.hung(), command)
    _out, err = process.communicate(timeout=20)
    assert (process.returncode, err) == (code, f"rosops.fleet: cannot start {command}: {why}\n")
