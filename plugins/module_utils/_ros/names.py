# SPDX-License-Identifier: GPL-3.0-or-later
"""Names in a ROS 1 graph, as the master shows them. Pure."""

from __future__ import annotations

import re
from fnmatch import fnmatchcase
from typing import Iterable, Mapping

# How anonymous names end, as a pattern: rospy's in process id and milliseconds, roscpp's in nanoseconds, those of
# $(anon) in a launch file in process id and a random number of at most 19 digits.
ANONYMOUS = r"(?:_\d+_\d{13,19}|_\d{18,})"
KEEPER = "ros_keeper"
_TOOL = re.compile(ANONYMOUS + r"\Z")
_TOOL_NAMES = ("rqt", "rosops_fleet", KEEPER)


def is_keeper(node: str) -> bool:
    """The keeper, which publishes for others: goals that it holds, and what a node had latched that was replaced."""
    return node.rpartition("/")[2] == KEEPER


def is_tool(node: str) -> bool:
    """A node that somebody has open to look at the graph, or that belongs to this collection."""
    return bool(_TOOL.search(node)) or node.rpartition("/")[2].startswith(_TOOL_NAMES)


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
