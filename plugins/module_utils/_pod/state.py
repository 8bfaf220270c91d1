# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the code in a pod knows: the app's settings, as they come with its revision, and what an earlier call left."""

# importing pathlib would cost as much as all the rest of a call:
# ruff: noqa: PTH103, PTH105, PTH123
from __future__ import annotations

import json
import os

from .._ros.names import resolve

TYPE_CHECKING = False  # typing's own costs its import
if TYPE_CHECKING:
    from typing import Any, Mapping

SCRATCH = f"/tmp/rosops-fleet-{os.getuid()}"  # noqa: S108
DEFAULTS = {"actions": [], "stop_deadline": 20, "command": None, "min_rates": {}, "keeper": None}


def load_settings(environ: Mapping[str, str]) -> dict[str, Any]:
    """The app's settings, with its node's full name as `node`.

    Without any, the node is looked for where the environment says, and nothing more.
    """
    name = environ.get("ROSOPS_NODE_NAME", "")
    found = _mapping(environ.get("ROSOPS_SETTINGS", ""))
    if not found:
        node = f"{environ.get('ROS_NAMESPACE', '').rstrip('/')}/{name}"
        found = {"node": node, "expect_node": bool(load_state(node))}
    settings = {**DEFAULTS, **found}
    if name:
        settings["node"] = f"{settings['node'].rpartition('/')[0]}/{name}"
    settings["actions"] = [resolve(action, node=settings["node"]) for action in settings["actions"]]
    settings["min_rates"] = {resolve(topic, node=settings["node"]): hz for topic, hz in settings["min_rates"].items()}
    return settings


def state_file(node: str) -> str:
    """Named after the node: a volume on /tmp may be another pod's, too."""
    return f"{SCRATCH}/{node.strip('/').replace('/', '.')}.json"


def load_state(node: str) -> dict[str, Any]:
    """What an earlier call found out; empty if there was none, or nothing can be kept here."""
    try:
        with open(state_file(node), encoding="utf-8") as file:
            return _mapping(file.read())
    except (OSError, ValueError):
        return {}


def save_state(node: str, state: Mapping[str, Any]) -> None:
    """Keep it for later calls. Where nothing can be written they look it up anew, which only takes longer."""
    path = state_file(node)
    try:
        os.makedirs(SCRATCH, 0o700, exist_ok=True)
        with open(f"{path}.new", "w", encoding="utf-8") as file:
            json.dump(state, file)
        os.replace(f"{path}.new", path)
    except OSError:
        pass


def _mapping(text: str) -> dict[str, Any]:
    try:
        content = json.loads(text)
    except ValueError:
        return {}
    return content if isinstance(content, dict) else {}
