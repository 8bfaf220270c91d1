# SPDX-License-Identifier: GPL-3.0-or-later
"""The whole fleet as the validation found it: what every later task of a run reads.

The playbook rosops.fleet.validate keeps it in the variable `fleet` of every host.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from ...module_utils._common.documents import Result, Variables
from ...module_utils._common.errors import SpecError
from .context import Robot
from .keys import plain, read
from .topology import ClusterPart

VARIABLE = "fleet"
UNNAMED = "fleet"  # the name of a fleet whose inventory says no `fleet_name`


@dataclass(frozen=True)
class Fleet:
    """Robots and hosts by their inventory names; `edge_nodes` are the edge hosts' names in their cluster."""

    robots: Mapping[str, Robot]
    hosts: Mapping[str, ClusterPart]
    edge_nodes: tuple[str, ...]
    name: str = ""  # the variable `fleet_name`, where the inventory says it

    def as_dict(self) -> Result:
        """The fleet in mappings, lists and scalars."""
        return dict(plain(self))

    @classmethod
    def from_vars(cls, task_vars: Variables) -> Fleet:
        """The fleet that an action plugin's variables hold; SpecError before the validation."""
        return read(cls, _found(task_vars))


@dataclass(frozen=True)
class Home:
    """The cluster that a host belongs to: the host's part in it, and the name of the fleet whose it is."""

    part: ClusterPart
    fleet: str


def home_from_vars(task_vars: Variables) -> Home | None:
    """Where the host of an action plugin's task belongs; None where no fleet was validated, or not with this host."""
    found = task_vars.get(VARIABLE)
    hosts = (isinstance(found, Mapping) and found.get("hosts")) or {}
    host = hosts.get(str(task_vars.get("inventory_hostname")))
    return Home(read(ClusterPart, host), str(found["name"])) if found and host else None


def home_of(task_vars: Variables) -> Home:
    """The same; SpecError where there is none."""
    home = home_from_vars(task_vars)
    if home is None:
        _found(task_vars)
        raise SpecError(
            f"{task_vars.get('inventory_hostname')} is no host of this fleet: it is in neither of the inventory's "
            "groups edge and robots, so it has no cluster"
        )
    return home


def robot_from_vars(task_vars: Variables) -> Robot:
    """The robot that an action plugin's task is about, without reading all the others; SpecError where it is none."""
    robots, name = _found(task_vars)["robots"], str(task_vars.get("inventory_hostname"))
    if name not in robots:
        raise SpecError(f"{name} is no robot of this fleet: it is not in the inventory's group robots")
    return read(Robot, robots[name])


def _found(task_vars: Variables) -> Variables:
    found = task_vars.get(VARIABLE)
    if not isinstance(found, Mapping) or "robots" not in found:
        raise SpecError(
            f"the variable {VARIABLE} is missing: the inventory was not validated in this run; import the playbook "
            "rosops.fleet.validate before this one, and leave its tags, validate and always, out of --skip-tags"
        )
    return found
