# SPDX-License-Identifier: GPL-3.0-or-later
"""The sidecar as the kubelet sees it: a path is a command, and a slow one holds up no other."""

from __future__ import annotations

import http.client
import os
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from unittest.mock import MagicMock, Mock

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._pod import sidecar
from ansible_collections.rosops.fleet.plugins.module_utils._pod.exec import reachable
from ansible_collections.rosops.fleet.tests.unit.plugins.fake_ros import until

CODE = Path(sidecar.__file__).read_text("utf-8")
# Stands for run.py: it is the sidecar, and what the sidecar starts. `begin` lasts until its file is there.
ENTRY = """
if sys.argv[1] == "sidecar":
    PORT = int(sys.argv[2])
    raise SystemExit(main(sys.argv[3:]))
import time
if sys.argv[1] == "exec":
    while not os.path.exists(sys.argv[-1]):
        time.sleep(0.01)
print("not ready: " + " ".join(sys.argv[1:]), flush=True)
raise SystemExit(sys.argv[1] == "started")
"""


@pytest.fixture
def port() -> int:
    with socket.socket() as chosen:
        chosen.bind(("127.0.0.1", 0))
        return int(chosen.getsockname()[1])


@pytest.fixture
def running(tmp_path: Path, port: int) -> Iterator[subprocess.Popen[str]]:
    script = tmp_path / "run.py"
    script.write_text(CODE + ENTRY)
    command = [sys.executable, "-I", "-S", str(script), "sidecar", str(port), "--after", str(tmp_path / "gone")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:  # noqa: S603 - our own
        assert reachable(("127.0.0.1", port))
        yield process
        process.kill()


def get(port: int, path: str, method: str = "GET") -> int:
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=20)
    connection.request(method, path)
    return connection.getresponse().status


def test_a_path_is_a_command_and_its_status_the_answer(running: subprocess.Popen[str], port: int) -> None:
    assert [get(port, path) for path in ("/stop", "/started", "/", "/stop/", "/keeper")] == [200, 503, 404, 404, 404]
    assert get(port, "/stop", "POST") == 404
    assert running.stdout is not None
    assert [running.stdout.readline() for _line in range(2)] == ["not ready: stop\n", "not ready: started\n"]


def test_a_stop_does_not_wait_for_a_start(running: subprocess.Popen[str], port: int, tmp_path: Path) -> None:
    """A pod may be ended while it waits for another one's end."""
    assert running.poll() is None
    begun: list[int] = []
    waiting = threading.Thread(target=lambda: begun.append(get(port, "/begin")), daemon=True)
    waiting.start()
    assert get(port, "/stop") == 200
    assert begun == []
    (tmp_path / "gone").touch()
    waiting.join(60)
    assert begun == [200]


@pytest.mark.usefixtures("running")
def test_whoever_says_nothing_or_hangs_up_costs_nothing(port: int) -> None:
    with socket.create_connection(("127.0.0.1", port)) as silent:
        socket.create_connection(("127.0.0.1", port)).close()
        assert get(port, "/stop") == 200
        silent.sendall(b"\x16\x03\x01 no http\r\n\r\n")
        assert silent.recv(100).startswith(b"HTTP/1.1 404 ")


@pytest.mark.usefixtures("running")
def test_who_asks_for_too_much_is_hung_up_on(port: int) -> None:
    """Others, who have an address of their own, are answered; and so is who has let go."""
    silent = [socket.create_connection(("127.0.0.1", port)) for _one in range(sidecar.OF_ONE)]
    with socket.create_connection(("127.0.0.1", port)) as one_more:
        assert one_more.recv(1) == b""
    other = http.client.HTTPConnection("127.0.0.1", port, timeout=20, source_address=("127.0.0.2", 0))
    other.request("GET", "/stop")
    assert other.getresponse().status == 200
    silent.pop().close()
    until(lambda: answers(port))
    for one in silent:
        one.close()


def test_a_pod_without_room_for_a_process_keeps_its_sidecar(monkeypatch: pytest.MonkeyPatch) -> None:
    """A stop or a start that is under way would end with it."""
    fork, asked = Mock(side_effect=[BlockingIOError, 7]), (MagicMock(), ("127.0.0.1", 1))
    monkeypatch.setattr(sidecar.os, "fork", fork)
    with pytest.raises(KeyboardInterrupt):
        sidecar.serve(Mock(accept=Mock(side_effect=[asked, asked, KeyboardInterrupt])), {})
    assert fork.call_count == 2


def answers(port: int) -> bool:
    try:
        return get(port, "/stop") == 200
    except (ConnectionError, http.client.HTTPException):
        return False


def test_it_ends_with_its_pod(running: subprocess.Popen[str]) -> None:
    os.kill(running.pid, signal.SIGTERM)
    assert running.wait(60) == 0
