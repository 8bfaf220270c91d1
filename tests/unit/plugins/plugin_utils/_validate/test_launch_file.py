# SPDX-License-Identifier: GPL-3.0-or-later
"""What is read in a launch file's text, and what is left to roslaunch."""

from __future__ import annotations

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._validate.launch_file import LONGEST, LaunchFile, Node, read

LIDAR = '<node pkg="urg_node" type="urg_node" name="lidar"/>'


def file_of(inside: str, namespace: str = "/", /, **args: str) -> LaunchFile:
    return read("/a.launch", f"<launch>\n{inside}\n</launch>", args, namespace)


def nodes(inside: str, namespace: str = "/", /, **args: str) -> list[str]:
    found = file_of(inside, namespace, **args)
    assert found.problems == []
    return [node.name for node in found.nodes]


def said(file: LaunchFile) -> list[str]:
    return [problem.line() for problem in file.problems]


def test_a_node_as_it_is_written() -> None:
    assert file_of(LIDAR).nodes == [Node("/lidar", "urg_node", "urg_node", place="/a.launch, line 2")]


@pytest.mark.parametrize(
    ("inside", "names"),
    [
        ("", []),
        (f'<group ns="a"><group ns="b">{LIDAR}</group><group>{LIDAR}</group></group>', ["/a/b/lidar", "/a/lidar"]),
        (f'<group ns="a"><group ns="/b">{LIDAR}</group></group>', ["/b/lidar"]),
        ('<group ns="a/"><node pkg="p" type="t" name="n" ns="b"/></group>', ["/a/b/n"]),
        ('<test pkg="p" type="t" test-name="n"/>', []),  # as roslaunch does
        (f"<!-- {LIDAR} -->", []),
        (f'<include file="b.launch">{LIDAR}</include>', []),
    ],
)
def test_names(inside: str, names: list[str]) -> None:
    assert nodes(inside) == names


EVAL = """<node pkg="p" type="t" name="$(eval '$(arg n)')"/>"""
NAMED = '<node pkg="p" type="t" name="$(arg n)"/>'


@pytest.mark.parametrize(
    ("inside", "args", "names"),
    [
        (f'<arg name="n" default="a"/>{NAMED}', {}, ["/a"]),
        (f'<arg name="n" default="a"/>{NAMED}', {"n": "b"}, ["/b"]),
        (f'<arg name="n" value="a"/>{NAMED}', {}, ["/a"]),
        (f'<arg name="m" default="a"/><arg name="n" default="$(arg m)_1"/>{NAMED}', {}, ["/a_1"]),
        (f'{NAMED}<arg name="n" default="a"/>', {}, ["/$(arg n)"]),
        (NAMED, {"n": "b"}, ["/b"]),  # declared or not
        (f'<group><arg name="n" default="a"/>{NAMED}</group>{NAMED}', {}, ["/a", "/$(arg n)"]),
        (f'<arg name="n" default="$(env N)"/>{NAMED}', {}, ["/$(env N)"]),
        (f'<arg name="n" default="a" if="false"/><arg name="n" default="b" unless="0"/>{NAMED}', {}, ["/b"]),
        (f'<arg name="n" default="a" if="$(env X)"/>{NAMED}', {}, ["/$(arg n)"]),
        (f'<group if="$(env X)"><arg name="n" default="a"/>{NAMED}</group>{NAMED}', {}, ["/a", "/$(arg n)"]),
        (f'<group if="$(env X)"><arg name="n" value="a"/></group>{NAMED}', {"n": "b"}, ["/b"]),
        (f'<arg name="n" default="a" if="$(env X)"/>{NAMED}', {"n": "b"}, ["/b"]),
        (EVAL, {"n": "b"}, ["/$(eval '$(arg n)')"]),  # roslaunch fills nothing in there
    ],
)
def test_arguments(inside: str, args: dict[str, str], names: list[str]) -> None:
    assert nodes(inside, **args) == names


@pytest.mark.parametrize(
    ("condition", "there", "sure"),
    [
        ('if=" True "', True, True),
        ('if="1"', True, True),
        ('unless="true"', False, True),
        ('unless="0"', True, True),
        ('if="$(arg on)"', True, True),
        ('if="$(arg off)"', False, True),
        ('if="$(arg nothing)"', True, False),
        ('unless="$(eval 1 + 1 == 2)"', True, False),
        ('if="$(env SIMULATED)"', True, False),
    ],
)
def test_conditions(condition: str, there: bool, sure: bool) -> None:
    args = '<arg name="on" default="true"/><arg name="off" default="false"/>'
    for inside in (
        f'<node pkg="p" type="t" name="n" {condition}/>',
        f'<group {condition}><group><node pkg="p" type="t" name="n"/></group></group>',
    ):
        assert [node.sure for node in file_of(args + inside).nodes] == [sure] * there


@pytest.mark.parametrize(
    ("args", "inside", "devices"),
    [
        ("", '<param name="port" value="$(arg port)"/>', ["/dev/ttyACM1"]),
        ("", '<param name="port" value=" /dev/ttyUSB0 "/>', ["/dev/ttyUSB0"]),
        ("", '<param name="port" value="/dev/$(env PORT)"/>', []),
        ("", '<param name="port" value="/dev/video0" if="false"/>', []),
        ("", '<param name="log" value="/dev/null"/><param name="log" value="/dev/shm/a"/>', []),
        ("", '<param name="path" value="/home/dev/a"/><param name="what" command="cat /dev/video0"/>', []),
        ("", '<remap from="a" to="/dev/video0"/>', []),
        ("/dev/ttyACM0", "", ["/dev/ttyACM0"]),
        ("_port:=/dev/ttyUSB0 _baud:=115200", "", ["/dev/ttyUSB0"]),
        ("'_port:=/dev/ttyUSB0' it's", "", []),  # no words
    ],
)
def test_devices(args: str, inside: str, devices: list[str]) -> None:
    port = '<arg name="port" default="/dev/ttyACM1"/><param name="/port" value="/dev/other"/>'
    (node,) = file_of(f'{port}<node pkg="p" type="t" name="n" args="{args}">{inside}</node>').nodes
    assert node.devices == devices


@pytest.mark.parametrize(
    ("args", "program", "manager"),
    [
        ("load usb_cam/Camera manager", ("usb_cam", "Camera"), "/front/manager"),
        ("load usb_cam/Camera /manager --no-bond", ("usb_cam", "Camera"), "/manager"),
        ("load usb_cam/Camera ~manager", ("usb_cam", "Camera"), "/front/camera/manager"),
        ("load usb_cam/Camera $(env MANAGER)", ("usb_cam", "Camera"), ""),
        ("standalone usb_cam/Camera", ("usb_cam", "Camera"), ""),
        ("load", ("nodelet", "nodelet"), ""),
        ("manager", ("nodelet", "nodelet"), ""),
    ],
)
def test_nodelets(args: str, program: tuple[str, str], manager: str) -> None:
    node = Node("/front/camera", "nodelet", "nodelet", args)
    assert (node.program, node.manager) == (program, manager)
    other = Node("/front/camera", "camera", "nodelet", args)
    assert (other.program, other.manager) == (("camera", "nodelet"), "")


@pytest.mark.parametrize(
    ("inside", "args", "words"),
    [
        ('<node pkg="p" type="t"/>', {}, "file: /a.launch, line 2: a <node> has no name"),
        ('<node type=" " name="n"/>', {}, "a <node> has no pkg and no type"),
        ('\n<node pkg="p" type="t" name="a/b"/>', {}, "file: /a.launch, line 3: the name a/b of a <node>"),
        ('<master auto="start"/>', {}, "has a <master>"),
        ('<node pkg="p" type="t" name="n" machine="arm"/>', {}, "/n is to start on the machine arm"),
        ('<machine name="arm" address="10.0.0.7"/><node pkg="p" type="t" name="n" machine="arm"/>', {}, "machine arm"),
        ('<machine name="a" address="b" default="true"/><node pkg="p" type="t" name="n"/>', {}, "machine a;"),
        ('<arg name="n"/>', {"m": "1"}, "args: lacks n, for which /a.launch, line 2, has neither"),
        ('<arg name="n" value="1"/>', {"n": "2"}, "args.n: is given, but /a.launch, line 2, sets it with value="),
    ],
)
def test_what_would_be_refused_at_the_start(inside: str, args: dict[str, str], words: str) -> None:
    (line,) = said(file_of(inside, **args))
    assert words in line and "; allowed: " in line


@pytest.mark.parametrize(
    "inside",
    [
        '<node pkg="p" type="t" name="n" machine="localhost"/>',
        '<machine name="me" address="localhost"/><node pkg="p" type="t" name="n" machine="me"/>',
        '<machine name="me" address="127.0.0.1"/><node pkg="p" type="t" name="n" machine="me"/>',
        '<machine name="me" address="$(env ROS_IP)"/><node pkg="p" type="t" name="n" machine="me"/>',
        '<machine name="me" address="b" if="$(env X)"/><node pkg="p" type="t" name="n" machine="me"/>',
        '<include file="machines.launch"/><node pkg="p" type="t" name="n" machine="me"/>',
        '<node pkg="p" type="t" name="n" machine="$(env ME)"/>',
        '<machine name="a" address="b"/><node pkg="p" type="t" name="n"/>',
        '<group if="false"><node pkg="p"/><arg name="n"/></group>',
        '<arg name="n" if="$(env X)"/>',
    ],
)
def test_what_is_not_known_judges_nothing(inside: str) -> None:
    assert said(file_of(inside)) == []


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("<launch>\n<node\n</launch>", "/a.launch, line 3, is no XML: "),
        ("", "/a.launch, line 1, is no XML: no element found"),
        ("<robot/>", "/a.launch, line 1: begins with <robot>"),
        ('<!DOCTYPE launch [\n<!ENTITY a SYSTEM "/etc/passwd">]><launch>&a;</launch>', "line 2, declares the entity a"),
        ('<!DOCTYPE l [<!ENTITY a "b"><!ENTITY c "&a;&a;">]><launch>&c;</launch>', "line 1, declares the entity a"),
    ],
)
def test_what_is_no_launch_file(text: str, words: str) -> None:
    found = read("/a.launch", text, {})
    (line,) = said(found)
    assert line.startswith("file: ") and words in line
    assert found.nodes == []


@pytest.mark.parametrize(
    ("inside", "takes"),
    [
        ('<arg name="a" default="1"/><group><arg name="b" default="1" if="false"/></group>', {"a", "b"}),
        ('<param name="p" value="$(arg c)"/><rosparam subst_value="true">x: $(arg d)</rosparam>', {"c", "d"}),
        ('<include file="b.launch"><arg name="e" value="1"/></include>', set()),
    ],
)
def test_arguments_that_it_has_a_use_for(inside: str, takes: set[str]) -> None:
    assert set(file_of(inside, c="1").takes) == takes


def test_an_expression_may_use_any_argument_that_it_names() -> None:
    assert "gain" in file_of('<param name="p" value="$(eval (1 + 1) * gain)"/>').takes


@pytest.mark.parametrize(
    ("inside", "whole", "passes_all"),
    [
        ("", True, False),
        ('<include file="b.launch"/>', False, False),
        ('<include file="b.launch" pass_all_args="true"/>', False, True),
        ('<include file="b.launch" pass_all_args="$(env X)"/>', False, True),
        ('<include file="b.launch" pass_all_args="False"/>', False, False),
        ('<include file="b.launch" pass_all_args="true" if="false"/>', True, False),
    ],
)
def test_includes(inside: str, whole: bool, passes_all: bool) -> None:
    found = file_of(inside)
    assert (found.whole, found.passes_all) == (whole, passes_all)


def test_arguments_made_of_arguments_do_not_grow_without_an_end() -> None:
    doubled = "".join(f'<arg name="a{i + 1}" default="$(arg a{i})$(arg a{i})"/>' for i in range(64))
    (node,) = file_of(f'<arg name="a0" default="n"/>{doubled}<node pkg="p" type="t" name="$(arg a64)"/>').nodes
    assert "$(" in node.name and len(node.name) <= LONGEST + 1


def test_any_depth_can_be_read() -> None:
    depth = 20_000
    assert nodes(f"{'<group>' * depth}{LIDAR}{'</group>' * depth}") == ["/lidar"]
