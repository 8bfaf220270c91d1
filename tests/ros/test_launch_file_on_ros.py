# SPDX-License-Identifier: GPL-3.0-or-later
"""What is read in a launch file's text, beside what real roslaunch makes of it. Nothing is started."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._validate.launch_file import read
from scene import PYTHON

pytestmark = pytest.mark.skipif(not shutil.which("roslaunch"), reason="no roslaunch here: Debian's python3-roslaunch")

# Of every case, one a line: the nodes that roslaunch would start, or null where it refuses to.
LOAD = """
import json, os, sys, roslaunch.config, roslaunch.core
from rosgraph.names import ns_join
for path, words, os.environ["ROS_NAMESPACE"] in json.load(sys.stdin):
    try:
        config = roslaunch.config.load_config_default([(path, words)], None)
        nodes = [[ns_join(n.namespace, n.name), n.package, n.type, n.args or ""] for n in config.nodes]
        elsewhere = [n.name for n in config.nodes if not roslaunch.core.is_machine_local(n.machine)]
        print("RESULT", json.dumps(None if elsewhere else nodes))
    except roslaunch.core.RLException as error:
        print("RESULT null")
"""
NODE = '<node pkg="p" type="t" name="n" args="-x $(arg x)"/>'
GOOD = [
    ("", {}),
    (f'<arg name="x" default="1"/>{NODE}', {}),
    (f'<arg name="x" default="1"/>{NODE}', {"x": "2"}),
    (f'<arg name="x"/>{NODE}', {"x": "2"}),
    (NODE, {"x": "undeclared"}),
    (f'<arg name="w" value="1"/><arg name="x" default="$(arg w)$(arg w)"/>{NODE}', {}),
    (f'<arg name="x" value="1"/><group ns="a"><arg name="y" value="2"/><group ns="b/">{NODE}</group></group>', {}),
    ('<group ns="a"><node pkg="p" type="t" name="n" ns="/b"/><node pkg="p" type="t" name="n" ns="c/"/></group>', {}),
    ('<group ns="/a"><group ns="/b"><node pkg="p" type="t" name="n"/></group></group>', {}),
    (f'<arg name="x" default="1" if="0"/><arg name="x" default="2" unless="false"/>{NODE}', {}),
    ('<arg name="x" default=" TRUE "/><node pkg="p" type="t" name="n" if="$(arg x)"/>', {}),
    ('<arg name="x" default="0"/><node pkg="p" type="t" name="n" if="$(arg x)"/>', {}),
    ('<group if="false"><node/><arg name="y" value="$(arg z)"/></group>', {}),
    ('<machine name="me" address="localhost"/><node pkg="p" type="t" name="n" machine="me"/>', {}),
    ('<test pkg="p" type="t" name="n" test-name="n"/>', {}),
    ("<!-- <node/> -->", {}),
]
BAD = [
    ("<group>", {}),
    ("&undefined;", {}),
    ("<node/>", {}),
    ('<node pkg="p" name="n"/>', {}),
    ('<node pkg="" type="t" name="n"/>', {}),
    ('<node pkg="p" type="t" name="a/b"/>', {}),
    ('<node pkg="p" type="t" name="n" machine="arm"/>', {}),
    ('<machine name="a" address="192.0.2.1" default="true"/><node pkg="p" type="t" name="n"/>', {}),
    (f'<arg name="x"/>{NODE}', {}),
    (f'<arg name="x"/>{NODE}', {"x": " "}),
    (f'<arg name="x" value="1"/>{NODE}', {"x": "2"}),
]


CASES = [(inside, args, space) for space in ("/", "/robot1") for inside, args in (*GOOD, *BAD)]


def text_of(inside: str) -> str:
    return f"<launch>{inside}</launch>"


@pytest.fixture(scope="module")
def roslaunch(tmp_path_factory: pytest.TempPathFactory) -> list[Any]:
    """What roslaunch makes of CASES."""
    place, asked = tmp_path_factory.mktemp("launch"), []
    for index, (inside, args, space) in enumerate(CASES):
        path = place / f"{index}.launch"
        path.write_text(text_of(inside), "utf-8")
        asked.append([str(path), [f"{name}:={value}" for name, value in args.items()], space])
    environ = {**os.environ, "ROS_HOME": str(place), "ROS_MASTER_URI": "http://127.0.0.1:1"}
    command = [PYTHON, "-c", LOAD]
    done = subprocess.run(  # noqa: S603 - our own words
        command, input=json.dumps(asked), env=environ, capture_output=True, text=True, check=True
    )
    said = [line.partition(" ")[2] for line in done.stdout.splitlines() if line.startswith("RESULT ")]
    return [json.loads(line) for line in said]


@pytest.mark.parametrize("index", range(len(CASES)), ids=lambda index: CASES[index][0] + CASES[index][2])
def test_roslaunch_takes_and_refuses_the_same(index: int, roslaunch: list[Any]) -> None:
    assert len(roslaunch) == len(CASES)
    inside, args, space = CASES[index]
    given = {name: value for name, value in args.items() if value.strip()}
    found = read("/a.launch", text_of(inside), given, space)
    nodes = [[node.name, node.package, node.type, node.args] for node in found.nodes]
    assert (None if found.problems else nodes) == roslaunch[index]
    assert bool(found.problems) == ((inside, args) in BAD)
