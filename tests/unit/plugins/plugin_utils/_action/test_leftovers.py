# SPDX-License-Identifier: GPL-3.0-or-later
"""What a killed run left is removed by the next one, and nothing else is."""

from __future__ import annotations

import os
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from ansible import constants as C  # noqa: N812 - its customary name
from ansible_collections.rosops.fleet.plugins.plugin_utils._action.access import Fetch
from ansible_collections.rosops.fleet.plugins.plugin_utils._action.leftovers import RUN, prefix, sweep
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.fleet import Home
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.topology import ClusterPart

HOME = Home(ClusterPart("server", "edge", ("edge1",), True, "edge1"), "production")
ADMIN = "clusters: [{cluster: {server: 'https://x:6443'}}]\nusers: [{user: {token: t}}]\n"
OWN = [f"{prefix()}edge.lock", f"{prefix()}edge.yaml"]


@pytest.fixture
def run() -> Iterator[subprocess.Popen[bytes]]:
    with subprocess.Popen(["/bin/sleep", "60"]) as process:
        yield process
        process.kill()


def run_of(process: int, root: Path) -> Path:
    """The directory of the run of this process, which has fetched its access."""
    directory = root / f"ansible-local-{process}a1b2c3d_"
    directory.mkdir(0o700, exist_ok=True)
    Fetch(directory, lambda _server: ADMIN, lambda *_: True).way(HOME, {"edge1": {}}, {})
    return directory


def names(directory: Path) -> list[str]:
    return sorted(path.name for path in directory.iterdir())


def test_a_directory_is_named_after_the_process_of_its_run() -> None:
    found = RUN.fullmatch(Path(C.DEFAULT_LOCAL_TMP).name)
    assert found and int(found[1]) > 1


def test_the_next_run_clears_what_a_killed_one_left(tmp_path: Path, run: subprocess.Popen[bytes]) -> None:
    killed = run_of(run.pid, tmp_path)
    (killed / "ansibles-own").write_text("a")
    (killed / f".{prefix()}edge.yaml.x1").write_text("half of a kubeconfig")
    now = run_of(os.getpid(), tmp_path)
    assert set(OWN) < set(names(killed))  # it is at work
    run.kill()
    run.wait()
    (now / f"{prefix()}edge.yaml").unlink()
    run_of(os.getpid(), tmp_path)
    assert names(killed) == ["ansibles-own"]
    assert names(now) == OWN


def test_a_number_that_was_given_out_again_is_another_process(tmp_path: Path, run: subprocess.Popen[bytes]) -> None:
    left = run_of(run.pid, tmp_path)
    os.utime(left, (time.time() - 3600,) * 2)
    assert sweep(tmp_path / "ansible-local-me") == [str(left / name) for name in OWN]


DEAD = 2**22 + 1  # beyond the largest number that the kernel gives


def left(directory: Path, start: str = prefix()) -> Path:
    directory.mkdir(0o700)
    for name in OWN:
        (directory / name.replace(prefix(), start)).write_text("x")
    return directory


def test_no_link_is_followed_and_nothing_of_others_is_touched(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    outside, unnamed = left(tmp_path / "outside"), left(tmp_path / "ansible-local-1a")
    (tmp_path / f"ansible-local-{DEAD}linklink").symlink_to(outside)
    shared = left(tmp_path / f"ansible-local-{DEAD}shared__")
    shared.chmod(0o770)  # anybody may have put a link into it
    # of a container, or of another machine with the same home directory
    away = left(tmp_path / f"ansible-local-{DEAD}away____", "rosops-fleet-0123456789ab-")
    before = [names(place) for place in (outside, unnamed, shared, away)]
    assert sweep(tmp_path / "ansible-local-me") == []
    assert [names(place) for place in (outside, unnamed, shared, away)] == before
    theirs = left(tmp_path / f"ansible-local-{DEAD}theirs__")
    monkeypatch.setattr(os, "getuid", lambda: 12345)
    assert sweep(tmp_path / "ansible-local-me") == []
    assert names(theirs) == OWN
