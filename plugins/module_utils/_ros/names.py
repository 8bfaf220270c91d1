# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Names in a ROS 1 graph, as the master shows them. Pure; imports nothing, because the readiness probe uses it."""

from __future__ import annotations

# How anonymous names end, as a pattern: rospy's in process id and milliseconds, roscpp's in nanoseconds, those of
# $(anon) in a launch file in process id and a random number of at most 19 digits.
ANONYMOUS = r"(?:_\d+_\d{13,19}|_\d{18,})"
KEEPER = "ros_keeper"


def is_keeper(node: str) -> bool:
    """The keeper, which publishes for others: goals that it holds, and what a node had latched that was replaced."""
    return node.rpartition("/")[2] == KEEPER


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
