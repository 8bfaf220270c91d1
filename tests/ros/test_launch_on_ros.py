# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a real roslaunch says of the processes that it started, of which some crash."""

from __future__ import annotations

import os
import shutil
import signal
import xmlrpc.client
from pathlib import Path

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._ros.backend import everything
from ansible_collections.rosops.fleet.plugins.module_utils._ros.client import Ros1Client
from ansible_collections.rosops.fleet.plugins.module_utils._ros.roslaunch import Child, children, crash
from ansible_collections.rosops.fleet.plugins.modules import ros_graph_info
from run_module import Run
from scene import NODES, PYTHON, Scene, until

pytestmark = pytest.mark.skipif(not shutil.which("roslaunch"), reason="no roslaunch here: Debian's python3-roslaunch")

HERE = "127.0.0.1"
LAUNCH = """<launch>
  <group ns="arm"><node pkg="made" type="ends" name="three" args="3"/></group>
  <node pkg="made" type="ends" name="zero" args="0"/>
  <node pkg="made" type="ends" name="again" args="4" respawn="true"/>
  <node pkg="made" type="ends" name="waits" args="5" respawn="true" respawn_delay="1000"/>
  <node pkg="made" type="listens" name="lives" required="true"/>
  <node pkg="made" type="listens" name="killed"/>
</launch>
"""
PACKAGE = """<package><name>made</name><version>1.0.0</version><description>for a test</description>
<maintainer email="nobody@example.org">nobody</maintainer><license>GPL-3.0-or-later</license></package>
"""


def package(scene: Scene) -> Path:
    """A ROS package with two programs: one ends with an exit code, one is a node, by roslaunch's name for it."""
    made = scene.directory / "made"
    made.mkdir()
    (made / "package.xml").write_text(PACKAGE)
    (made / "all.launch").write_text(LAUNCH)
    named = 'for word in "$@"; do case $word in __name:=*) name=${word#__name:=};; esac; done'
    programs = {
        "ends": "sleep 0.3; exit $1",
        "listens": f'{named}\nexec {PYTHON} {NODES} listener "$name" "{scene.directory}/$name.jsonl"',
    }
    for name, text in programs.items():
        (made / name).write_text(f"#!/bin/sh\n{text}\n")
        (made / name).chmod(0o755)
    return made


def launch(scene: Scene) -> None:
    scene.start_master()
    # else `roslaunch --wait` waits for somebody to set it
    xmlrpc.client.ServerProxy(scene.uri).setParam("/tester", "/run_id", "made")
    made = package(scene)
    scene.environment = {"ROS_PACKAGE_PATH": str(made), "HUSH": "a secret"}
    scene._start("roslaunch", shutil.which("roslaunch") or "", "--wait", str(made / "all.launch"))


def test_who_lives_ended_or_crashes_again_and_again(scene: Scene, run: Run) -> None:
    launch(scene)
    ros = Ros1Client(scene.uri, 5.0)

    def found() -> dict[str, Child]:
        return {child.node: child for child in children(ros, {HERE})}

    def ended() -> bool:
        now = found()
        # for a tenth of a second it does say how they have ended
        forgotten = all(now[name].unexplained for name in ("/arm/three", "/zero"))
        return forgotten and not now["/waits"].alive and now["/again"].spawned > 2

    until("their ends", ended)
    until("the nodes", lambda: {"/lives", "/killed"} <= set(scene.registered()))
    graph = ros.ask(state := ros.state(), everything(state))
    pid = graph.node("/killed").pid
    assert pid is not None
    now = found()
    assert crash(now.pop("/again")).startswith("was started again ")
    assert {name: crash(child, graph) for name, child in now.items()} == {
        "/arm/three": "",  # it may have done its work, as the next one has
        "/zero": "",
        "/waits": "ended with exit code 5",
        "/lives": "",
        "/killed": "",
    }
    os.kill(pid, signal.SIGKILL)
    until("its end", lambda: found()["/killed"].unexplained)

    now, graph = found(), ros.ask(state, everything(state))
    assert crash(now["/killed"], graph) == "died, as its registration is still there"
    assert [name for name in sorted(now) if now[name].unexplained] == ["/arm/three", "/killed", "/zero"]
    assert [(now[name].respawn, now[name].required, now[name].alive) for name in ("/lives", "/waits")] == [
        (False, True, True),
        (True, False, False),
    ]
    assert "secret" not in repr(now)

    launched = {row["node"]: row for row in run(ros_graph_info)["graph"]["launched"]}
    assert set(launched) == set(now)
    assert launched["/killed"]["crash"] == "died, as its registration is still there"
    assert launched["/waits"]["exit_code"] == 5
    assert children(ros, {"10.42.0.7"}) == []
