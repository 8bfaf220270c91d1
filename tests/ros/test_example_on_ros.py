# SPDX-License-Identifier: GPL-3.0-or-later
"""The nodes of the example `launch` that `rosops.fleet.new` writes, started as the pods of its two apps start them."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._pod import launch as launcher
from scene import PYTHON, Scene, until

pytestmark = pytest.mark.skipif(not shutil.which("roslaunch"), reason="no roslaunch here: Debian's python3-roslaunch")

BASE = Path(__file__).resolve().parents[2] / "playbooks" / "files" / "examples" / "launch" / "images" / "base"


def subscribers(scene: Scene, topic: str) -> set[str]:
    return {name for name, entry in scene.registered().items() if topic in dict(entry.subscriptions)}


def test_its_launch_file_and_its_monitor_find_each_other(scene: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("CLOUD_TOKEN", raising=False)
    scene.start_master()
    package = scene.directory / "base"
    shutil.copytree(BASE, package)
    for script in package.glob("*.py"):
        script.chmod(0o755)  # as its Dockerfile does
    scene.environment = {"ROS_PACKAGE_PATH": str(package), "PATH": "/usr/bin:/bin", "ROSOPS_REVISION": "11111111"}
    scene._start("base", PYTHON, "-u", launcher.__file__, "--overlap", "--package=base", "base.launch", "rate:=20")
    until("its subscriber", lambda: subscribers(scene, "/wheel_speed") == {"/mean_11111111"})

    assert scene._start("blind", PYTHON, str(package / "monitor.py")).wait(20) != 0
    assert "CLOUD_TOKEN" in scene.said("blind")
    scene.environment |= {"CLOUD_TOKEN": "open sesame"}
    scene._start("monitor", PYTHON, "-u", str(package / "monitor.py"))
    until("means in the monitor's log", lambda: scene.said("monitor").count("mean speed 0.50 m/s") > 3)
