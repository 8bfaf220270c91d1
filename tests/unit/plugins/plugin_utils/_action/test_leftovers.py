# SPDX-License-Identifier: GPL-3.0-or-later
"""What a killed run left is removed by the next one, and nothing else is."""

from __future__ import annotations

import contextlib
import json
import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._action import leftovers
from ansible_collections.rosops.fleet.plugins.plugin_utils._action.access import Fetch
from ansible_collections.rosops.fleet.plugins.plugin_utils._action.leftovers import OWNER, USED, has_ended, sweep
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.fleet import Home
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.topology import ClusterPart

HOME = Home(ClusterPart("server", "edge", ("edge1",), True, "edge1"), "production")
ADMIN = "clusters: [{cluster: {server: 'https://x:6443'}}]\nusers: [{user: {token: t}}]\n"
OWN = ["rosops-fleet-edge.lock", "rosops-fleet-edge.yaml", OWNER, USED]
FORKED = multiprocessing.get_context("fork")


def run_of(directory: Path) -> None:
    directory.mkdir(0o700, exist_ok=True)
    Fetch(directory, lambda _server: ADMIN, lambda *_: True).way(HOME, {"edge1": {}}, {})


def worker(directory: Path, ready: Connection) -> None:
    run_of(directory)
    ready.send(os.getpid())
    signal.pause()


def playbook(directory: Path, ready: Connection) -> None:
    """A run: it fetches its access in a worker, as tasks do, and goes on."""
    os.setsid()
    FORKED.Process(target=worker, args=(directory, ready)).start()
    signal.pause()


Start = Callable[[Path], tuple[int, int]]


@pytest.fixture
def start() -> Iterator[Start]:
    """Starts a run; its process, and its worker's."""
    runs: list[Any] = []

    def begin(directory: Path) -> tuple[int, int]:
        mine, its = FORKED.Pipe()
        runs.append(FORKED.Process(target=playbook, args=(directory, its)))
        runs[-1].start()
        assert mine.poll(30)
        return runs[-1].pid, mine.recv()

    yield begin
    for run in runs:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(run.pid, signal.SIGKILL)
        run.join()


def wait_for_the_end(process: int) -> None:
    """Of one that this process is no parent of; its locks are gone then."""
    with contextlib.suppress(ProcessLookupError):
        assert wait([os.pidfd_open(process)], 30)


def names(directory: Path) -> list[str]:
    return sorted(path.name for path in directory.iterdir())


def test_the_next_run_clears_what_a_killed_one_left(tmp_path: Path, start: Start) -> None:
    killed, now = tmp_path / "ansible-local-1a", tmp_path / "ansible-local-2b"
    process, own = start(killed)
    (killed / "ansibles-own").write_text("a")
    (killed / ".rosops-fleet-edge.yaml.x1").write_text("half of a kubeconfig")
    run_of(now)
    assert set(OWN) < set(names(killed))  # it is at work
    os.killpg(process, signal.SIGKILL)
    wait_for_the_end(process)
    wait_for_the_end(own)
    (now / "rosops-fleet-edge.yaml").unlink()
    run_of(now)
    assert names(killed) == ["ansibles-own"]
    assert names(now) == OWN


def test_a_task_that_outlives_its_run_keeps_its_access(tmp_path: Path, start: Start) -> None:
    """SIGKILL ends ansible-playbook alone; its workers let go of robots first, by that access."""
    killed = tmp_path / "ansible-local-1a"
    process, own = start(killed)
    os.kill(process, signal.SIGKILL)
    wait_for_the_end(process)
    assert sweep(tmp_path / "ansible-local-2b") == []
    assert names(killed) == OWN
    os.kill(own, signal.SIGKILL)
    wait_for_the_end(own)
    assert sweep(tmp_path / "ansible-local-2b") == [str(killed / name) for name in (*sorted({*OWN} - {OWNER}), OWNER)]
    assert names(killed) == []


DEAD = {**leftovers.owner_at_work(), "started": "0"}


@pytest.mark.parametrize(
    ("change", "ended"),
    [
        ({}, True),
        ({"boot": "before"}, True),
        ({"boot": "before", "processes": "pid:[1]"}, True),
        ({"processes": "pid:[1]"}, False),  # a container's: which of its processes live is not seen from here
        ({"machine": "another"}, False),  # with the same home directory
        ({"machine": "another", "boot": "before"}, False),
        ({"started": leftovers.owner_at_work()["started"]}, False),
        ({"process": 2**22 + 1}, True),
        ({"more": "of a later release"}, False),
    ],
)
def test_a_run_has_ended_only_where_that_is_certain(change: dict[str, Any], ended: bool) -> None:
    assert has_ended({**DEAD, **change}) is ended
    assert not has_ended({})


def left(directory: Path, owner: Any = DEAD) -> Path:
    directory.mkdir(mode=0o700)
    for name in (USED, "rosops-fleet-edge.yaml"):
        (directory / name).write_text("x")
    (directory / OWNER).write_text(json.dumps(owner))
    return directory


def test_no_link_is_followed_and_nothing_of_others_is_touched(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    outside = left(tmp_path / "outside")
    (tmp_path / "ansible-local-link").symlink_to(outside)
    strange = left(tmp_path / "ansible-local-strange", owner=["no", "owner"])
    nobody = left(tmp_path / "ansible-local-nobody")
    (nobody / OWNER).unlink()
    shared = left(tmp_path / "ansible-local-shared")  # anybody may have put a link into it
    shared.chmod(0o770)
    before = [names(place) for place in (outside, strange, nobody, shared)]
    assert sweep(tmp_path / "ansible-local-me") == []
    assert [names(place) for place in (outside, strange, nobody, shared)] == before
    theirs = left(tmp_path / "ansible-local-theirs")
    monkeypatch.setattr(os, "getuid", lambda: 12345)
    assert sweep(tmp_path / "ansible-local-me") == []
    assert names(theirs) == before[0]
