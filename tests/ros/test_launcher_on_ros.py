# SPDX-License-Identifier: GPL-3.0-or-later
"""Launch files with real roslaunch and rospy: two versions at once, and what is said of processes that crash."""

from __future__ import annotations

import os
import shutil
import signal
import xmlrpc.client
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._pod import launch as launcher
from ansible_collections.rosops.fleet.plugins.module_utils._ros import jobs
from ansible_collections.rosops.fleet.plugins.module_utils._ros.backend import everything
from ansible_collections.rosops.fleet.plugins.module_utils._ros.client import Ros1Client
from ansible_collections.rosops.fleet.plugins.module_utils._ros.roslaunch import Child, children, crash
from scene import NODES, PYTHON, Scene, until

pytestmark = pytest.mark.skipif(not shutil.which("roslaunch"), reason="no roslaunch here: Debian's python3-roslaunch")

ONE, TWO, HERE = "11111111", "22222222", ["127.0.0.1"]
LAUNCH = """<launch>
  <arg name="area" default="hall"/>
  <arg name="gain" default="1"/>
  <param name="/area" value="$(arg area)"/>
  <group ns="arm"><node pkg="made" type="private" name="camera"><param name="gain" value="$(arg gain)"/></node></group>
  <node pkg="made" type="listens" name="driver"/>
  <node pkg="made" type="listens" name="$(anon tool)"/>
</launch>
"""
ENDS = """<launch>
  <node pkg="made" type="listens" name="lives"/>
  <node pkg="made" type="ends" name="three" args="3"/>
  <node pkg="made" type="ends" name="zero" args="0"/>
</launch>
"""
CRASHES = """<launch>
  <group ns="arm"><node pkg="made" type="ends" name="three" args="3"/></group>
  <node pkg="made" type="ends" name="zero" args="0"/>
  <node pkg="made" type="ends" name="again" args="4" respawn="true"/>
  <node pkg="made" type="ends" name="waits" args="5" respawn="true" respawn_delay="1000"/>
  <node pkg="made" type="listens" name="lives" required="true"/>
  <node pkg="made" type="listens" name="killed"/>
</launch>
"""
REQUIRED = """<launch><node pkg="made" type="ends" name="needed" args="7" required="true"/></launch>"""
MISSING = """<launch><node pkg="made" type="nothing" name="absent"/></launch>"""
DEAF = """<launch><node pkg="made" type="deaf" name="deaf"/></launch>"""
PACKAGE = """<package><name>made</name><version>1.0.0</version><description>for a test</description>
<maintainer email="nobody@example.org">nobody</maintainer><license>GPL-3.0-or-later</license></package>
"""
PRIVATE = f"""#!{PYTHON}
import rospy
from std_msgs.msg import Int64
rospy.init_node("camera")
rospy.Publisher("~image", Int64, queue_size=1, latch=True).publish(rospy.get_param("~gain"))
rospy.spin()
"""


@pytest.fixture(autouse=True)
def made(scene: Scene) -> None:
    """A master, and a ROS package with launch files and what they start."""
    scene.start_master()
    xmlrpc.client.ServerProxy(scene.uri).setParam("/tester", "/run_id", "made")
    directory = scene.directory / "made"
    directory.mkdir()
    named = 'for word in "$@"; do case $word in __name:=*) name=${word#__name:=};; esac; done'
    listens = f'#!/bin/sh\n{named}\nexec {PYTHON} {NODES} listener "$name" "{scene.directory}/$name.jsonl"\n'
    files = {
        "package.xml": PACKAGE,
        "two.launch": LAUNCH,
        "ends.launch": ENDS,
        "crashes.launch": CRASHES,
        "required.launch": REQUIRED,
        "missing.launch": MISSING,
        "deaf.launch": DEAF,
        "private": PRIVATE,
        "listens": listens,
        "ends": "#!/bin/sh\nsleep 0.3; exit $1\n",
        "deaf": "#!/bin/sh\ntrap '' INT TERM\nwhile :; do sleep 1; done\n",
    }
    for name, text in files.items():
        (directory / name).write_text(text)
        (directory / name).chmod(0o755)
    scene.environment = {"ROS_PACKAGE_PATH": str(directory)}


def start(scene: Scene, version: str, *words: str) -> None:
    """`version`: what is behind its nodes' names; without a template one of a collection up to 1.0."""
    revision, _word, template = version.partition("_")
    scene.environment |= {"ROSOPS_REVISION": revision, "ROSOPS_TEMPLATE_HASH": template}
    scene._start(version, PYTHON, "-u", launcher.__file__, *words)


def nodes(scene: Scene, revision: str) -> set[str]:
    return {name.removesuffix(f"_{revision}") for name in scene.registered() if name.endswith(revision)}


def tools(scene: Scene) -> int:
    """How many have the name that the launch file makes up."""
    return len([name for name in scene.registered() if name.startswith("/tool_")])


def publishers(scene: Scene, topic: str) -> set[str]:
    return {name for name, entry in scene.registered().items() if topic in dict(entry.publications)}


def param(scene: Scene, name: str) -> Any:
    return xmlrpc.client.ServerProxy(scene.uri).getParam("/tester", name)[2]


def end(scene: Scene, name: str) -> int:
    scene.kill(name, signal.SIGTERM)
    # a signal that meets roslaunch as it starts a process waits for its lock, for 20 s
    return scene.processes[name].wait(60)


OVERLAP = ("--overlap", "--replace=driver", "--package=made", "two.launch")


@pytest.mark.parametrize(
    ("one", "two"),
    [(ONE, f"{TWO}_79d9c6f8b5"), (f"{ONE}_79d9c6f8b5", f"{ONE}_45678945")],
    ids=["a version of before and one of now", "two pods of one revision"],
)
def test_two_versions_side_by_side(scene: Scene, one: str, two: str) -> None:
    start(scene, one, *OVERLAP)
    # nobody knows the private name yet: the node is started once more, with it
    until("the private name in its place", lambda: publishers(scene, "/arm/camera/image") == {f"/arm/camera_{one}"})
    until("the first version", lambda: nodes(scene, one) == {"/arm/camera", "/driver"})
    until("its tool", lambda: tools(scene) == 1)

    start(scene, two, *OVERLAP, "gain:=2")
    until("the second version", lambda: nodes(scene, two) == {"/arm/camera"})
    both = {f"/arm/camera_{one}", f"/arm/camera_{two}"}
    until("both under the name that others know", lambda: publishers(scene, "/arm/camera/image") == both)
    assert (param(scene, f"/arm/camera_{one}/gain"), param(scene, f"/arm/camera_{two}/gain")) == (1, 2)
    until("a tool of each one's own", lambda: tools(scene) == 2)

    assert end(scene, one) == 0
    until("the driver, when the old one has ended", lambda: nodes(scene, two) == {"/arm/camera", "/driver"})
    assert nodes(scene, one) == set()
    # the old one's went with it; others read the node's parameter by the name that they know
    assert param(scene, "/arm") == {"camera": {"gain": 2}, f"camera_{two}": {"gain": 2}}
    assert len(param(scene, "/roslaunch/uris")) == 1
    assert end(scene, two) == 0


def test_a_version_that_would_change_what_the_old_one_reads_does_not_begin(scene: Scene) -> None:
    start(scene, ONE, *OVERLAP)
    until("the first version", lambda: publishers(scene, "/arm/camera/image") == {f"/arm/camera_{ONE}"})
    start(scene, TWO, *OVERLAP, "area:=yard")
    assert scene.processes[TWO].wait(20) == 1
    assert "/area would change under the version at work; take handoff: replace" in scene.said(TWO)
    assert param(scene, "/area") == "hall"
    assert nodes(scene, ONE) == {"/arm/camera", "/driver"}


def test_how_processes_ended_is_remembered(scene: Scene) -> None:
    start(scene, ONE, "--package=made", "ends.launch")
    ros = Ros1Client(scene.uri, 5.0)

    def ended() -> dict[str, str]:
        return {child.node: crash(child) for child in children(ros, HERE) if not child.alive}

    until("their ends", lambda: set(ended()) == {"/three", "/zero"})
    assert ended() == {"/three": "ended with exit code 3", "/zero": ""}


@pytest.mark.parametrize(
    ("words", "status", "said"),
    [
        (["required.launch"], 7, ""),
        (["missing.launch"], 1, "rosops.fleet: absent could not be started: cannot launch node of type [made/nothing]"),
        (["nowhere.launch"], 1, "nowhere.launch"),
        (["--overlap", "--replace=other", "two.launch"], 1, "launch.replace names other, which is none of its nodes"),
    ],
)
def test_what_goes_wrong_ends_it(scene: Scene, words: list[str], status: int, said: str) -> None:
    start(scene, ONE, "--package=made", *words)
    assert scene.processes[ONE].wait(20) == status
    assert said in scene.said(ONE)


def test_a_deaf_node_costs_seconds(scene: Scene) -> None:
    start(scene, ONE, "--package=made", "deaf.launch")
    until("the node", lambda: [child.alive for child in children(Ros1Client(scene.uri, 5.0), HERE)] == [True])
    assert end(scene, ONE) == 0
    assert "escalating to SIGKILL" in scene.said(ONE)


def unexplained(child: Child) -> bool:
    return not child.alive and child.exit_code is None


def test_who_lives_ended_or_crashes_again_and_again(scene: Scene) -> None:
    scene.environment["HUSH"] = "a secret"
    path = f"{scene.environment['ROS_PACKAGE_PATH']}/crashes.launch"
    scene._start("roslaunch", shutil.which("roslaunch") or "", "--wait", path)
    ros = Ros1Client(scene.uri, 5.0)

    def found() -> dict[str, Child]:
        return {child.node: child for child in children(ros, HERE)}

    def ended() -> bool:
        now = found()
        # for a tenth of a second it does say how they have ended
        forgotten = all(unexplained(now[name]) for name in ("/arm/three", "/zero"))
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
    until("its end", lambda: unexplained(found()["/killed"]))

    now, graph = found(), ros.ask(state, everything(state))
    assert crash(now["/killed"], graph) == "died, as its registration is still there"
    assert [name for name in sorted(now) if unexplained(now[name])] == ["/arm/three", "/killed", "/zero"]
    assert [(now[name].respawn, now[name].required, now[name].alive) for name in ("/lives", "/waits")] == [
        (False, True, True),
        (True, False, False),
    ]
    assert "secret" not in repr(now)

    launched = {row["node"]: row for row in jobs.graph({"master_uri": scene.uri})["graph"]["launched"]}
    assert set(launched) == set(now)
    assert launched["/killed"]["crash"] == "died, as its registration is still there"
    assert launched["/waits"]["exit_code"] == 5
    assert children(ros, {"10.42.0.7"}) == []
