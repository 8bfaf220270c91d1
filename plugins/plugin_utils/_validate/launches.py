# SPDX-License-Identifier: GPL-3.0-or-later
"""An app's launch files against what the app says of them, where their text is in the inventory. Pure.

Where it is in the image only, nothing is judged here: what the graph of the robot shows is judged when it is updated.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

from ...module_utils._pod.launch import named
from .._model.app import App, File, Launch, env_value
from .._model.finding import Problem, each, taken
from .launch_file import LaunchFile, Node, is_known, read

_POSE = "two estimates of where the robot is would fight"
_MAP = "two would make two maps, and both say where the robot is"
_MOVES = "two of it would both move the robot"
_DEVICE = "it has one device, and the two would both drive it"

# Well-known nodes of which there must not be two: package -> the types of its nodes and nodelets, as a pattern, and the
# reason. The same as users read in docs/apps.md, "Common packages". What is not in here the graph of the robot judges
# when it is updated (`_update/nodes.py`); but neither a device nor a file that both would write to shows there.
SINGLE: dict[str, tuple[str, str]] = {
    "amcl": ("amcl", _POSE),
    "robot_localization": ("(?i:ekf|ukf).*", _POSE),
    "robot_pose_ekf": ("robot_pose_ekf", _POSE),
    "gmapping": ("(?i:slam_?gmapping).*", _MAP),
    "hector_mapping": ("hector_mapping", _MAP),
    "slam_toolbox": (".*slam_toolbox_node", _MAP),
    "cartographer_ros": ("cartographer_(offline_)?node", _MAP),
    "move_base": ("move_base", "it serves an action, of which two servers lose goals, and " + _MOVES),
    "twist_mux": ("twist_mux", _MOVES),
    "teleop_twist_joy": ("teleop_node", _MOVES),
    "teleop_twist_keyboard": (r"teleop_twist_keyboard\.py", _MOVES),
    "controller_manager": ("spawner", "at its end it would unload the controllers of the new one, too"),
    "urg_node": ("urg_node", _DEVICE),
    "rplidar_ros": ("rplidarNode", _DEVICE),
    "usb_cam": ("usb_cam_node", _DEVICE),
    "realsense2_camera": ("realsense2_camera_node|RealSenseNodeFactory", _DEVICE),
    "velodyne_driver": ("velodyne_node|DriverNodelet", _DEVICE),
}


def launch_problems(app: App, launch: Launch, namespace: str) -> Iterator[Problem]:
    """Problems of the launch files that can be read; `namespace` is where their nodes are."""
    args = {name: str(env_value(value)) for name, value in launch.args.items()}
    # roslaunch takes no argument without a value from its command line
    given = {name: value for name, value in args.items() if value.strip()}
    texts = [item for file in launch.file if (item := written(app.files, launch.package, file))]
    files = [read(item.path, item.content, given, namespace) for item in texts]
    nodes = [node for file in files for node in file.nodes if is_known(node.name)]
    found = [*(problem for file in files for problem in file.problems), *_twice(nodes)]
    if not found and len(files) == len(launch.file):
        found += _unknown_args(launch, files)
    if not found and app.handoff == "overlap":
        known = all(file.whole and all(is_known(node.name) for node in file.nodes) for file in files)
        whole = len(files) == len(launch.file) and known
        found += [*(_unknown_nodes(launch, nodes) if whole else ()), *_verdicts(launch, nodes, whole)]
    return (problem.below("launch") for problem in found)


def written(files: Sequence[File], package: str, name: str) -> File | None:
    """The item with the text of a launch file: that at its whole path, or the only one below the package's directory,
    where roslaunch finds it at any depth."""
    if name.startswith("/"):
        found = [item for item in files if item.path == name]
    else:
        below = f"/{package}/"
        found = [
            item for item in files if below in item.path and f"/{item.path.partition(below)[2]}".endswith(f"/{name}")
        ]
    return found[0] if len(found) == 1 and not found[0].secret else None


def _twice(nodes: Sequence[Node]) -> Iterator[Problem]:
    """roslaunch refuses them. Of two that depend on what is not known here only one may be there."""
    sure = [node for node in nodes if node.sure]
    for at, name, first in taken(enumerate(node.name for node in sure)):
        found = f"{sure[at].place}: {name} is at {sure[first].place}, too"
        yield Problem("file", found, "each node with a name of its own")


def _unknown_args(launch: Launch, files: Sequence[LaunchFile]) -> Iterator[Problem]:
    if any(file.passes_all for file in files):
        return
    takes = sorted(set().union(*(file.takes for file in files)))
    for name in launch.args:
        if name not in takes:
            allowed = "one of " + ", ".join(takes) if takes else "no args: it has no <arg>"
            yield Problem(f"args.{name}", "is no <arg> of the launch file", allowed)


def _unknown_nodes(launch: Launch, nodes: Sequence[Node]) -> Iterator[Problem]:
    names = list(dict.fromkeys(node.name for node in nodes))
    for where, word in [*each("replace", launch.replace), *each("overlap", launch.overlap)]:
        if not named(word, names):
            allowed = "one of " + ", ".join(names) if names else "leave it out"
            yield Problem(where, f"is {word}, which the launch file does not start", allowed)


def _verdicts(launch: Launch, nodes: Sequence[Node], whole: bool) -> Iterator[Problem]:
    """`whole`: these are all nodes that there are."""
    names = {node.name for node in nodes}
    for node in nodes:
        who = f"lacks the node {node.name} ({'/'.join(node.program)})"
        if _listed(node, launch.replace):
            continue
        if whole and node.manager and node.manager not in names:
            found = f"{who}: the launch file does not start its manager {node.manager}, which takes it only once"
            yield Problem("replace", found, "list it in launch.replace, or handoff: replace")
        elif not _listed(node, launch.overlap) and (reason := why_single(node)):
            allowed = "list it in launch.replace, or in launch.overlap if two of it do no harm"
            yield Problem("replace", f"{who}: {reason}", allowed)


def _listed(node: Node, words: Sequence[str]) -> bool:
    return any(named(word, [node.name]) for word in words)


def why_single(node: Node) -> str:
    """Why there must not be two of a node, in words; empty: nothing known forbids it."""
    package, kind = node.program
    kinds, reason = SINGLE.get(package, ("", ""))
    if kinds and re.fullmatch(kinds, kind):
        return reason
    if package == "rosbag" and any(word.startswith(("-O", "--output-name")) for word in node.words):
        return "-O names one file, and both would write to it"
    return f"{node.devices[0]} is one device, and the two would both drive it" if node.devices else ""
