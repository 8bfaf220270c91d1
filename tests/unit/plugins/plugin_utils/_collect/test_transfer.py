# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Files of a claim brought here by the very code of the host, in one process: nothing lost or torn."""

from __future__ import annotations

import base64
import hashlib
import os
import subprocess
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._host.claims import listing, opened_data, pieces, wire
from ansible_collections.rosops.fleet.plugins.plugin_utils._collect import transfer
from ansible_collections.rosops.fleet.plugins.plugin_utils._collect.store import Store
from ansible_collections.rosops.fleet.plugins.plugin_utils._collect.transfer import (
    CHANGED,
    FETCHED,
    GONE,
    GREW,
    Piece,
    fetch,
    wanted,
)

ODD = [b"a b/c  d", b"\xff\xfe", b"line\nend", b"back\\slash", "grün".encode(), b"%2e%2e", b"-rf", b"empty"]


class Robot:
    """A claim's directory, and what happens there between two looks."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.asked: list[Piece] = []
        self.then: Callable[[], object] = lambda: None

    def write(self, path: bytes, data: bytes) -> None:
        file = self.root / os.fsdecode(path)
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(data)

    def answer(self, wanted: list[Piece]) -> list[dict[str, Any]]:
        self.asked += wanted
        found = pieces(str(self.root), wanted)
        self.then()
        return found

    @property
    def read(self) -> int:
        return sum(piece["length"] for piece in self.asked)


@pytest.fixture
def robot(tmp_path: Path) -> Robot:
    (tmp_path / "claim").mkdir()
    return Robot(tmp_path / "claim")


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return Store(tmp_path / "results", "robot1/logs")


def collect(robot: Robot, store: Store, match: str = "*") -> dict[str, str]:
    files = listing(str(robot.root), [match]).files
    return fetch(robot.answer, store, files, wanted(store, files))


def here(store: Store) -> dict[bytes, bytes]:
    paths = [path for path in store.folder.rglob("*") if path.is_file()]
    return {os.fsencode(path.relative_to(store.folder)): path.read_bytes() for path in paths}


@pytest.fixture(autouse=True)
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(transfer, "BATCH", 1000)
    monkeypatch.setattr(transfer, "MANY", 3)


def test_files_of_any_name_and_size_come_whole(robot: Robot, store: Store) -> None:
    texts = {name: os.urandom(700 * number) for number, name in enumerate(reversed(ODD))}
    for name, data in texts.items():
        robot.write(name, data)
    assert set(collect(robot, store).values()) == {FETCHED}
    assert here(store) == texts
    assert collect(robot, store) == {}  # a second run has nothing to do
    checked = subprocess.run(  # noqa: S603 - GNU's own program
        ["/usr/bin/sha256sum", "--check", "--strict", "--quiet", store.sums],
        cwd=store.folder,
        capture_output=True,
        check=False,
    )
    assert (checked.returncode, checked.stdout) == (0, b"")
    assert not (store.folder.parents[1] / ".partial").exists()


def test_no_more_is_asked_for_at_a_time_than_a_batch(robot: Robot, store: Store) -> None:
    robot.write(b"bag", os.urandom(5500))
    batches: list[int] = []

    def answer(wanted: list[Piece]) -> list[dict[str, Any]]:
        batches.append(sum(piece["length"] for piece in wanted))
        return robot.answer(wanted)

    files = listing(str(robot.root), ["*"]).files
    fetch(answer, store, files, wanted(store, files))
    assert batches == [1000] * 5 + [500]


def test_what_was_begun_is_gone_on_with(robot: Robot, store: Store) -> None:
    data = os.urandom(5000)
    robot.write(b"bag", data)

    class CutError(Exception):
        pass

    def cut() -> None:
        if robot.read >= 3000:
            raise CutError

    robot.then = cut
    with pytest.raises(CutError):
        collect(robot, store)
    assert here(store) == {}
    robot.then, robot.asked = (lambda: None), []
    assert collect(robot, store) == {"bag": FETCHED}
    assert robot.read == 3000  # of 5000, 2000 were here
    assert here(store) == {b"bag": data}


def test_a_file_that_was_replaced_after_it_was_begun_comes_from_its_beginning(robot: Robot, store: Store) -> None:
    store.start("bag", 10)
    store.append("bag", 0, b"another one")
    robot.write(b"bag", b"not that file")
    assert collect(robot, store) == {"bag": FETCHED}
    assert here(store) == {b"bag": b"not that file"}


def test_a_log_that_has_grown_since_brings_its_new_end_only(robot: Robot, store: Store) -> None:
    robot.write(b"log", b"x" * 2500)
    collect(robot, store)
    robot.write(b"log", b"x" * 2500 + b"y" * 400)
    robot.asked = []
    assert collect(robot, store) == {"log": FETCHED}
    assert robot.read == 400
    assert here(store) == {b"log": b"x" * 2500 + b"y" * 400}


def test_a_log_that_grows_meanwhile_is_what_it_was_and_it_is_told(robot: Robot, store: Store) -> None:
    robot.write(b"log", b"x" * 2500)
    robot.then = lambda: (robot.root / "log").open("ab").write(b"more")
    assert collect(robot, store) == {"log": GREW}
    assert here(store) == {b"log": b"x" * 2500}


@pytest.mark.parametrize("later", [b"z" * 2500, b"short"], ids=["as long", "shorter"])
def test_a_file_that_is_written_anew_meanwhile_is_not_kept(robot: Robot, store: Store, later: bytes) -> None:
    robot.write(b"state", b"a" * 100)
    collect(robot, store)
    robot.write(b"state", b"x" * 2500)
    robot.asked = []
    robot.then = lambda: robot.write(b"state", later) if robot.read else None
    assert collect(robot, store) == {"state": CHANGED}
    assert here(store) == {b"state": b"a" * 100}  # what was here stays


def test_another_file_in_its_place_is_not_taken_for_it(robot: Robot, store: Store) -> None:
    robot.write(b"map", b"x" * 2500)

    robot.write(b"new", b"x" * 2500)

    def replaced() -> None:
        if (robot.root / "new").exists():
            (robot.root / "new").replace(robot.root / "map")

    robot.then = replaced
    assert collect(robot, store, "map") == {"map": CHANGED}


def test_a_file_that_goes_meanwhile_is_told(robot: Robot, store: Store) -> None:
    robot.write(b"old", b"x" * 2500)
    robot.then = lambda: (robot.root / "old").unlink(missing_ok=True)
    assert collect(robot, store) == {"old": GONE}
    assert here(store) == {}


def test_patterns(robot: Robot, store: Store) -> None:
    for name in (b"a.bag", b"runs/b.bag", b"runs/b.log"):
        robot.write(name, b"x")
    collect(robot, store, "*.bag")
    assert {*here(store)} == {b"a.bag", b"runs/b.bag"}


def test_no_link_is_followed_and_no_pipe_waited_for(robot: Robot, store: Store, tmp_path: Path) -> None:
    secret = tmp_path / "secret"
    secret.mkdir()
    (secret / "shadow").write_bytes(b"hunter2")
    (robot.root / "link").symlink_to(secret / "shadow")
    (robot.root / "directory").symlink_to(secret)
    os.mkfifo(robot.root / "pipe")
    found = listing(str(robot.root), ["*"])
    assert (found.files, sorted(found.passed)) == ({}, ["directory", "link", "pipe"])
    # they may take a file's place once it was listed
    state = {"size": 7, "mtime_ns": 1, "inode": 1}
    for name in ("link", "directory/shadow", "pipe"):
        assert fetch(robot.answer, store, {name: state}, [name]) == {name: GONE}
    assert here(store) == {}


@pytest.mark.parametrize("path", ["../x", "/etc/shadow", "a/../../x", "a//b", "", "%2e%2e/x", "a%00"])
def test_a_path_leads_nowhere_else_on_either_side(robot: Robot, store: Store, path: str) -> None:
    with pytest.raises(Exception, match="is no path below a claim"):
        robot.answer([{"path": path, "offset": 0, "length": 1, "check": None}])
    with pytest.raises(Exception, match="is no path below a claim"):
        store.path(path)


def test_sums_are_of_what_is_here(robot: Robot, store: Store) -> None:
    robot.write(b"a", b"1")
    collect(robot, store)
    robot.write(b"b", b"2")
    collect(robot, store)
    lines = [f"{hashlib.sha256(data).hexdigest()}  {name}\n" for name, data in (("a", b"1"), ("b", b"2"))]
    assert store.sums.read_text() == "".join(lines)
    assert wire(b"\xff a") == "%FF a"


def test_a_piece_never_becomes_more_than_was_asked_for() -> None:
    """A thousandth of it comes over the wire, and all of it would be this process' memory."""
    bomb = {"data": base64.b64encode(zlib.compress(bytes(64 << 20))).decode()}
    assert len(opened_data(bomb, 1 << 20)) == 1 << 20
    assert opened_data(bomb, 0) == b""
