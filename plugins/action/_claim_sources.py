# SPDX-License-Identifier: GPL-3.0-or-later
"""For the role collect: which directories of the host at hand are collected, and where to. Asks no host."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import PurePosixPath
from typing import Any, ClassVar

from ..module_utils._common.documents import Arguments, Result, Variables
from ..plugin_utils._action.base import FleetAction
from ..plugin_utils._model.claims import sources
from ..plugin_utils._model.names import FLEET_NAMESPACE, robot_namespace
from ..plugin_utils._model.topology import members


class ActionModule(FleetAction):
    """`found` names the variable in which every host of the play has what `find` saw there.

    `missing` are the `volumes` of which no host has a claim, for the first host alone; `silent` who did not answer.
    """

    _requires_connection = False
    ARGUMENTS: ClassVar = {
        "found": {"type": "str", "required": True},
        "robots": {"type": "list", "elements": "str", "required": True},
        "volumes": {"type": "list", "elements": "str", "required": True},
    }

    def work(self, params: Arguments, known: Variables) -> Result:
        play, me = list(known["ansible_play_hosts_all"]), known["inventory_hostname"]
        found = {host: _directories(known["hostvars"][host].get(params["found"])) for host in play}
        all_of_them = sources(
            {host: there for host, there in found.items() if there is not None},
            {FLEET_NAMESPACE, *map(robot_namespace, params["robots"])},
            {robot: robot_namespace(robot) for robot in members(known["groups"], "robots")},
            params["volumes"],
        )
        first = me == known["ansible_play_hosts"][0]
        there = {source.volume for source in all_of_them}
        return {
            "changed": False,
            "sources": [source._asdict() for source in all_of_them if source.host == me],
            "missing": [volume for volume in params["volumes"] if first and volume not in there],
            "silent": [host for host in play if found[host] is None],
        }


def _directories(found: Any) -> list[str] | None:
    """The names of the directories; None where the host did not answer. What makes no sense is none."""
    listed = found.get("files") if isinstance(found, Mapping) else None
    if not isinstance(listed, list):
        return None
    return [PurePosixPath(str(one.get("path"))).name for one in listed if isinstance(one, Mapping)]
