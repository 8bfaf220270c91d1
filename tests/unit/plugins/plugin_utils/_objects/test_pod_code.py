# SPDX-License-Identifier: GPL-3.0-or-later
"""What starts a launch file, in an image whose ROS lies below /opt/ros."""

from __future__ import annotations

import subprocess
from pathlib import Path

from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.pod_code import LAUNCHER


def launched(*places: Path) -> tuple[int, str, str]:
    path = ":".join([*map(str, places), "/usr/bin", "/bin"]) if places else "/nowhere"
    done = subprocess.run(  # noqa: S603 - our own words
        ["/bin/sh", "-c", LAUNCHER, "roslaunch", "a.launch"],
        env={"PATH": path},
        capture_output=True,
        text=True,
        check=False,
    )
    return done.returncode, done.stdout, done.stderr


def test_a_command_without_the_entry_point_is_told_of_it() -> None:
    """An image like ros:noetic has roslaunch, and its PATH leads there only after the entry point."""
    status, _out, said = launched()
    assert status == 127
    assert said == ("rosops.fleet: this image has no roslaunch, or /ros_entrypoint.sh is not in its command\n")


def test_it_runs_on_roslaunchs_own_interpreter(tmp_path: Path) -> None:
    program = tmp_path / "roslaunch"
    program.write_text("#!/bin/echo by\n")
    program.chmod(0o755)
    status, out, said = launched(tmp_path)
    assert (status, said) == (0, "")
    assert out.split()[0] == "by"
    assert out.split()[-1] == "a.launch"
