# SPDX-License-Identifier: GPL-3.0-or-later
"""Names in a ROS 1 graph, as the master shows them. Pure."""

from __future__ import annotations

import re
from fnmatch import fnmatchcase
from typing import Collection, Iterable, Mapping

# How anonymous names end, as a pattern: rospy's in process id and milliseconds, roscpp's in nanoseconds, those of
# $(anon) in a launch file in process id and a random number of at most 19 digits.
ANONYMOUS = r"(?:_\d+_\d{13,19}|_\d{18,})"
KEEPER = "ros_keeper"
_TOOL = re.compile(ANONYMOUS + r"\Z")
# Behind the name of a node where versions of its app overlap: the revision, and the hash that Kubernetes has of the
# pod's template (the label pod-template-hash, SafeEncodeString of apimachinery), which others change, too. Pods of
# collections up to 1.0 have the revision alone.
REVISION, TEMPLATE = r"_[0-9a-f]{8}", r"_[bcdfghjklmnpqrstvwxz2456789]{1,10}"
_OF_REVISION = re.compile(REVISION + r"(?=/|\Z)")
_OF_POD = re.compile(f"({REVISION}){TEMPLATE}" + r"(?=/|\Z)")
_VERSION = re.compile(f"{REVISION}(?:{TEMPLATE})?" + r"\Z")
_TOOL_NAMES = ("rqt", "rosops_fleet", KEEPER)


def is_keeper(node: str) -> bool:
    """The keeper, which publishes for others: goals that it holds, and what a node had latched that was replaced."""
    return node.rpartition("/")[2] == KEEPER


def is_tool(node: str) -> bool:
    """A node that somebody has open to look at the graph, or that belongs to this collection."""
    return bool(_TOOL.search(node)) or node.rpartition("/")[2].startswith(_TOOL_NAMES)


# ---- names of versions. What is written down of a revision holds for all of its pods: it has the revision's names


def by_revision(name: str) -> str:
    """What a graph name is called by its revision, whichever of its pods has it.

    >>> by_revision("/camera_1a2b3c4d_79d9c6f8b5/image"), by_revision("/camera_1a2b3c4d"), by_revision("/camera_5")
    ('/camera_1a2b3c4d/image', '/camera_1a2b3c4d', '/camera_5')
    """
    return _OF_POD.sub(r"\1", name)


def by_pod(registered: Iterable[str]) -> dict[str, list[str]]:
    """The revision's name -> those of its nodes, one for each pod, of all that have another one."""
    found: dict[str, list[str]] = {}
    for name in registered:
        if by_revision(name) != name:
            found.setdefault(by_revision(name), []).append(name)
    return found


def in_pods(name: str, templates: Mapping[str, str]) -> str:
    """The reverse of by_revision: what a name is in the pods of these templates, by revision the hash of each."""
    return _OF_REVISION.sub(lambda it: f"{it[0]}_{templates[it[0][1:]]}" if it[0][1:] in templates else it[0], name)


def is_meant(node: str, names: Collection[str]) -> bool:
    """Whether one of the names is the node's own, or its revision's."""
    return node in names or by_revision(node) in names


def stem(node: str) -> str:
    """The node's name in all versions."""
    return _VERSION.sub("", node)


def is_version(node: str, base: str) -> bool:
    """Whether it is the node of a version of an app whose node is called `base` where versions do not overlap."""
    return node == base or (node.startswith(base) and not stem(node[len(base) :]))


# ---- names in words


def matches(name: str, patterns: Iterable[str]) -> bool:
    """Whether a graph name is one of these, or of a pattern of them: `*` stands for anything, slashes among it."""
    return any(fnmatchcase(name, pattern) for pattern in patterns)


def renamed(name: str, renames: Mapping[str, str]) -> str:
    """A graph name after the nodes' renaming: a node's own name, and what stands in its private namespace."""
    if name in renames:
        return renames[name]
    for old, new in renames.items():
        if name.startswith(f"{old}/"):
            return new + name[len(old) :]
    return name


def resolve(name: str, namespace: str = "/", node: str = "") -> str:
    """A graph name made absolute (wiki: ROS/Names, "Resolving").

    A relative name stands under the namespace, a private one (`~name`) under the node, which is an absolute name.

    >>> resolve("temperature", "/robot1", "/robot1/sensor")
    '/robot1/temperature'
    >>> resolve("~rate", "/robot1", "/robot1/sensor")
    '/robot1/sensor/rate'
    >>> resolve("temperature", "robot1/")
    '/robot1/temperature'
    """
    if name.startswith("~"):
        return f"{node}/{name[1:].lstrip('/')}"
    full = name if name.startswith("/") else f"{namespace.rstrip('/')}/{name}"
    return full if full.startswith("/") else f"/{full}"
