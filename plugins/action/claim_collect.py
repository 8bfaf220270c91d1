# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Collect the files of the host's claims into a directory of the control node."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar
from urllib.parse import unquote

from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import FleetError
from ansible_collections.rosops.fleet.plugins.plugin_utils._action.base import FleetAction
from ansible_collections.rosops.fleet.plugins.plugin_utils._action.host import ActionHost
from ansible_collections.rosops.fleet.plugins.plugin_utils._collect.sources import (
    Asked,
    Source,
    missing,
    sources,
    strange,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._collect.store import Store
from ansible_collections.rosops.fleet.plugins.plugin_utils._collect.transfer import (
    CHANGED,
    FETCHED,
    GONE,
    GREW,
    fetch,
    wanted,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.names import robot_namespace
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.topology import members

MODULE = "rosops.fleet.claim_files"
AGAIN = "what an app writes anew while it is read cannot be collected; run again while it rests"


class ActionModule(FleetAction):
    ARGUMENTS: ClassVar = {
        "listed": {"type": "str", "required": True},
        "dest": {"type": "path", "required": True},
        "namespaces": {"type": "list", "elements": "str", "required": True},
        "claims": {"type": "list", "elements": "str", "default": []},
        "storage": {"type": "path", "default": "/var/lib/rancher/k3s/storage"},
    }

    def work(self, params: Mapping[str, Any], known: dict[str, Any]) -> dict[str, Any]:
        play: list[str] = list(known["ansible_play_hosts_all"])
        listed = {host: known["hostvars"][host].get(params["listed"], {}).get("claims") for host in play}
        said = {host: claims for host, claims in listed.items() if claims is not None}
        me = known["inventory_hostname"]
        lacking = [*missing(said, params["claims"])] if me == known["ansible_play_hosts"][0] else []
        asked = Asked(
            frozenset(params["namespaces"]),
            {robot: robot_namespace(robot) for robot in members(known["groups"], "robots")},
        )
        mine = [source for source in sources(said, asked) if source.host == me]
        found = [one for source in mine for one in self._collected(source, params, known)]
        result: dict[str, Any] = {
            "changed": any(one["outcome"] in (FETCHED, GREW) for one in found),
            "files": found,
            "warnings": [
                f"{one['target']}/{one['path']}: {one['outcome']}" for one in found if one["outcome"] in (GREW, GONE)
            ],
            "passed": [f"{source.target}/{unquote(name)}" for source in mine for name in source.passed],
        }
        silent = [host for host in play if host not in said]
        problems = [f"{one['target']}/{one['path']}: {CHANGED}; {AGAIN}" for one in found if one["outcome"] == CHANGED]
        problems += [
            f"{directory!r} is no directory of a claim, though {me} says so. Nothing of it was written; find out who "
            "has changed that host"
            for directory in strange(said.get(me, []))
        ]
        problems += [_lacking(volume, silent) for volume in lacking]
        return {**result, "failed": True, "msg": "\n".join(problems)} if problems else result

    def _collected(self, source: Source, params: Mapping[str, Any], known: dict[str, Any]) -> list[dict[str, Any]]:
        """What became of each file that is not here yet. In check mode all of them would be fetched."""
        store = Store(Path(params["dest"]).absolute(), source.target)
        try:
            names = wanted(store, source.files)
            if self._task.check_mode:
                outcomes = dict.fromkeys(names, FETCHED)
            else:
                host = ActionHost(self, known)
                args = {"storage": params["storage"], "directory": source.directory}
                outcomes = fetch(lambda pieces: _asked(host, args, pieces), store, source.files, names)
        except OSError as error:
            raise FleetError(f"{store.folder}: {error}; give a directory with room that is yours as dest") from error
        return [
            {"target": source.target, "path": unquote(name), "size": source.files[name]["size"], "outcome": outcome}
            for name, outcome in outcomes.items()
        ]


def _asked(host: ActionHost, args: Mapping[str, Any], pieces: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    found = host.module(MODULE, {**args, "pieces": [*pieces]})
    if "pieces" not in found:
        raise FleetError(
            f"claims of the host cannot be read: {found.get('msg', found)}; run again, it goes on from there"
        )
    return list(found["pieces"])


def _lacking(volume: str, silent: Sequence[str]) -> str:
    asked = f"; {', '.join(silent)} did not answer" if silent else ""
    return (
        f"{volume}: no host of this run has a claim of this volume{asked}; name one of persistent_storage, leave out "
        "--limit (an app of the edge has its claim there), and mind that only claims of local-path lie on hosts"
    )
