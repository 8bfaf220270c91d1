# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests with a real ROS 1 master and real nodes: on machines that have Debian's rospy, rosmaster and actionlib."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Generator, Iterator
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).resolve().parents[2]
# the tests import what stands beside them, and our own tools
sys.path[:0] = [str(Path(__file__).parent), str(CHECKOUT / "tests" / "tools")]
TREE = CHECKOUT / ".ansible" / "collections"
if (TREE / "ansible_collections" / "rosops" / "fleet").exists():
    sys.path.insert(0, str(TREE))

NEEDED = "import actionlib.msg, rosmaster, rospy, std_msgs.msg, std_srvs.srv"


def why_not() -> str:
    """Why there is no ROS here, in the words of the Python that should have it."""
    try:
        tried = subprocess.run(["/usr/bin/python3", "-c", NEEDED], capture_output=True, text=True, check=False)  # noqa: S603 - a command of our own
    except OSError as error:
        return str(error)
    return tried.stderr.strip().splitlines()[-1] if tried.returncode else ""


REASON = why_not()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    here = [item for item in items if Path(__file__).parent in item.path.parents]
    if REASON:
        for item in here:
            item.add_marker(pytest.mark.skip(reason=f"no ROS 1 on this machine: {REASON}"))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """With what the processes said last: what fails once in hundreds of times has to tell why by itself."""
    report = yield
    scene = getattr(item, "funcargs", {}).get("scene")
    if call.when == "call" and report.failed and scene:
        report.sections += scene.last_words()
    return report


@pytest.fixture
def scene(tmp_path: Path) -> Iterator[object]:
    from scene import Scene  # noqa: PLC0415 - it imports the collection, for which the path is set here

    made = Scene(tmp_path)
    try:
        yield made
    finally:
        made.end()
