# SPDX-License-Identifier: GPL-3.0-or-later
"""The probes and the stop hook as pods run them, against a real master and real nodes on loopback."""

from __future__ import annotations

import json
import os
import subprocess
import time
import xmlrpc.client
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from pod_code import write_code
from scene import PYTHON, Scene, until

SETTINGS = {
    "expect_node": True, "actions": [], "stop_deadline": 20, "command": None, "min_rates": {}, "keeper": None,
}  # fmt: skip


class Pod:
    """What stands for one: a node's name, its settings, and the mounted code."""

    def __init__(self, scene: Scene, name: str, **settings: Any) -> None:
        self.scene = scene
        # what calls keep lies in /tmp by the node's name: one of its own for each test
        self.name = f"{name}_{scene.port}"
        self.node = f"/{self.name}"
        self.revision = "0a1b2c3d"
        self.hooks = scene.directory / f"pod_{name}" / "hooks"
        self.hooks.mkdir(parents=True)
        write_code(self.hooks)
        self.settings = json.dumps({**SETTINGS, "node": f"/{name}", **settings})

    def call(self, word: str) -> tuple[int, str]:
        python = os.environ.get("HOOK_PYTHON", PYTHON)
        command = [python, "-I", "-S", str(self.hooks / "run.py"), word]
        env = {
            "PATH": os.environ["PATH"], "ROS_MASTER_URI": self.scene.uri, "ROSOPS_SETTINGS": self.settings,
            "ROSOPS_NODE_NAME": self.name, "ROSOPS_REVISION": self.revision,
        }  # fmt: skip
        done = subprocess.run(command, env=env, capture_output=True, text=True, check=False, timeout=60)  # noqa: S603
        return done.returncode, done.stdout.strip() + done.stderr

    def forget(self) -> None:
        for left in Path(f"/tmp/rosops-fleet-{os.getuid()}").glob(f"{self.name}.json*"):  # noqa: S108
            left.unlink()


@pytest.fixture
def pods(scene: Scene) -> Iterator[Any]:
    made: list[Pod] = []

    def pod(name: str, **settings: Any) -> Pod:
        made.append(Pod(scene, name, **settings))
        return made[-1]

    yield pod
    for item in made:
        item.forget()


@pytest.mark.parametrize("own_name", [False, True])
def test_what_was_set_at_run_time_is_kept_by_the_next_version_and_by_the_way_back(
    scene: Scene, pods: Any, own_name: bool
) -> None:
    """With a name of its own, as under overlap, a version begins beside the one before; else after its end."""
    given = {"~rate": 20, "~pid": {"gain": 1.5, "names": ["a"]}, "~off": 0, "/limits/speed": 2}
    old, new = (pods(word, params=given, keep_params=["~rate", "~pid", "~tuned", "/limits"]) for word in ("old", "new"))
    plain = pods("plain", params={"~rate": 10})  # keeps nothing
    for pod, revision in ((old, "0a1b2c3d"), (new, "4e5f6071"), (plain, "8c9dae0f")):
        pod.revision = revision
        pod.name = f"talker_{scene.port}" + (f"_{pod.revision}" if own_name else "")
        pod.node = f"/{pod.name}"
    scene.start_master()
    master = xmlrpc.client.ServerProxy(scene.uri)

    def begin(pod: Pod) -> str:
        status, said = pod.call("exec")
        assert status == 0, said
        scene.start("talker", pod.node)
        assert pod.call("started") == (0, "")
        return said

    def end(pod: Pod) -> None:
        assert pod.call("stop") == (0, "")
        scene.processes[pod.node].wait(5)

    assert begin(old) == ""
    for name, value in {f"{old.node}/rate": 35, f"{old.node}/pid/gain": 2.5, f"{old.node}/off": 1,
                        f"{old.node}/tuned": True, "/limits/speed": 3}.items():  # fmt: skip
        master.setParam("/test", name, value)
    kept = {"rate": 35, "pid": {"gain": 2.5, "names": ["a"]}, "off": 0, "tuned": True}
    for before, after in ((old, new), (new, old), (old, plain), (plain, old)):
        if not own_name:
            end(before)
        said = begin(after)
        if own_name:
            end(before)
        there = master.getParam("/test", "/")[2]
        if after is plain:
            assert (said, there[after.name]["rate"]) == ("", 10)
            continue
        names = f"{after.node}/rate, {after.node}/pid/gain, /limits/speed"
        assert said == f"rosops.fleet: kept as they were, not as params say: {names}\n"
        assert there[after.name] == kept
        assert there["limits"] == {"speed": 3}
        told = [f"{after.name}_kept"] if own_name else []
        assert {key for key in there if key.startswith("talker")} == {after.name, *told}


def test_a_subscriber_that_came_in_the_same_moment_is_told_of_the_publisher(scene: Scene, pods: Any) -> None:
    pod = pods("talker")
    scene.start_master()
    scene.start("unlucky", "/listener")
    scene.until_registered("/listener")
    scene.start("talker", pod.node)
    assert pod.call("started") == (0, "")
    until("numbers", lambda: scene.log("/listener")[-1].get("count"))


def test_a_call_that_takes_long_is_let_end_and_a_client_at_rest_is_not_waited_for(scene: Scene, pods: Any) -> None:
    """rospy's threads end with the process: the caller of a node that is shut down at once gets an error."""
    pod = pods("planner")
    scene.start_master()
    scene.start("service", pod.node, "/trigger", "6")
    assert pod.call("started") == (0, "")
    scene.start("caller", "/resting", "/trigger", "persistent")
    until("an answer", lambda: len(scene.log("/resting")) > 0)
    scene.start("caller", "/caller")
    until("a call", lambda: sum("asked" in line for line in scene.log(pod.node)) == 2)
    began = time.monotonic()
    assert pod.call("stop") == (0, "")
    assert time.monotonic() - began < 15  # a client that is waited for takes 17, all that the deadline allows
    until("the answer", lambda: len(scene.log("/caller")) > 0)
    assert scene.log("/caller")[0]["ok"] is True
