# SPDX-License-Identifier: GPL-3.0-or-later
"""What the code in a pod knows: the app's settings, what an earlier call left, and where its master is."""

# importing pathlib would cost as much as all the rest of a call:
# ruff: noqa: PTH103, PTH105, PTH123
from __future__ import annotations

import json
import os
from dataclasses import asdict, dataclass, field, fields, replace
from typing import Any, Mapping, Sequence, TypeVar

from .._common.documents import Data
from .._ros.client import Ros1Client
from .._ros.names import resolve

SCRATCH = f"/tmp/rosops-fleet-{os.getuid()}"  # noqa: S108
CALLER = "/rosops_fleet_pod"
TIMEOUT = 2.0
Said = TypeVar("Said")


@dataclass(frozen=True)
class Settings:
    """Of the app, as `pod_settings.py` of the control node writes them; names are whole ones of this version.

    `revision` and `version` are the pod's: of its template, and what is behind the names of its nodes where versions of
    its app overlap (`_ros/names.py`).
    """

    node: str
    expect_node: bool = False  # the app's node has that name; others are found by the pod's address
    app: str = ""
    actions: Sequence[str] = ()
    stop_deadline: float = 20
    command: list[str] | None = None
    min_rates: Mapping[str, float] = field(default_factory=dict)
    keeper: str | None = None
    host_network: bool = False
    space: str = ""  # the robot's namespace on a master that robots share
    launch: str = ""  # the handoff of an app that is a launch file
    held: Sequence[str] = ()  # nodes of it of which there must not be two
    on_demand: bool = False  # what it has on the graph is its clients' wish
    params: Mapping[str, Any] = field(default_factory=dict)
    keep_params: Sequence[str] = ()
    revision: str = ""
    version: str = ""


@dataclass(frozen=True)
class State:
    """What an earlier call found out: where the app's node is, for calls without a master, or that it was not ready."""

    uri: str = ""
    pid: int | None = None
    services: Mapping[str, str] = field(default_factory=dict)
    failed: bool = False


def load_settings(environ: Mapping[str, str]) -> Settings:
    """With the names that this very pod gives its node, and what is private to that."""
    name = environ.get("ROSOPS_NODE_NAME", "")
    found = _as(Settings, {"node": "", **_mapping(environ.get("ROSOPS_SETTINGS", ""))})
    node = f"{found.node.rpartition('/')[0]}/{name}" if name else found.node
    actions = [resolve(action, node=node) for action in found.actions]
    rates = {resolve(topic, node=node): hz for topic, hz in found.min_rates.items()}
    revision, template = environ.get("ROSOPS_REVISION", ""), environ.get("ROSOPS_TEMPLATE_HASH", "")
    version = "_".join(filter(None, (revision, template)))
    return replace(found, node=node, actions=actions, min_rates=rates, revision=revision, version=version)


def state_file(node: str) -> str:
    """Named after the node and its master: a volume on /tmp may be another pod's, too, be it another robot's."""
    master = os.environ.get("ROS_MASTER_URI", "").rstrip("/").rpartition("/")[2]
    return f"{SCRATCH}/{node.strip('/').replace('/', '.')}@{master}.json"


def load_state(node: str) -> State:
    """Empty if there was no earlier call, or nothing can be kept here."""
    try:
        with open(state_file(node), encoding="utf-8") as file:
            return _as(State, _mapping(file.read()))
    except (OSError, ValueError):
        return State()


def save_state(node: str, state: State) -> None:
    """Keep it for later calls. Where nothing can be written they look it up anew, which only takes longer."""
    path = state_file(node)
    try:
        os.makedirs(SCRATCH, 0o700, exist_ok=True)
        with open(f"{path}.new", "w", encoding="utf-8") as file:
            json.dump(asdict(state), file)
        os.replace(f"{path}.new", path)
    except OSError:
        pass


def ros_of(environ: Mapping[str, str], timeout: float = TIMEOUT) -> Ros1Client:
    return Ros1Client(environ.get("ROS_MASTER_URI", "http://localhost:11311"), timeout, CALLER)


def _as(kind: type[Said], found: Data) -> Said:
    """What it knows of it: the other side may be of a newer collection, or of an older one."""
    known = {one.name for one in fields(kind)}  # type: ignore[arg-type] # typeshed knows no protocol of dataclasses here
    return kind(**{key: value for key, value in found.items() if key in known})


def _mapping(text: str) -> Data:
    try:
        content = json.loads(text)
    except ValueError:
        return {}
    return content if isinstance(content, dict) else {}
