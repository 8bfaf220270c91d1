# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which nodes of the ROS graph are an app's, and what the next version's are called. Pure.

An app has the node of its name, or all that its pod started. Those of a launch file have the names that it gives them;
where its versions overlap, each with its revision behind it (`_pod/launch.py`).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from ...module_utils._pod.launch import LOGGERS, MANAGER, named, owner_of
from ...module_utils._ros.graph import host_of
from ...module_utils._ros.names import is_tool
from ...module_utils._step.objects import node_of, suffix_of
from .._model import names
from .._model.app import App
from .intended import on_demand
from .world import Graph, Object

_HELD = "--replace="


def own_nodes(named: Mapping[str, str], graph: Graph, pods: Iterable[Object]) -> dict[str, list[str]]:
    """App -> its nodes, that of `named` first, whether it is in the graph or not.

    What a launch file starts has names of its own, but its pod's address. An address of several apps' pods (that of the
    host, where they share its network) tells nothing.
    """
    apps_at: dict[str, set[str]] = {}
    for pod in pods:
        address = (pod.get("status") or {}).get("podIP")
        if address:
            apps_at.setdefault(address, set()).add(pod["metadata"]["labels"].get(names.LABEL_APP, ""))
    at = {node.name: host_of(node.uri) for name in graph.names for node in graph.named(name)}
    found = {}
    for app, name in named.items():
        others = [node for node, address in at.items() if apps_at.get(address) == {app} and not is_tool(node)]
        found[app] = list(dict.fromkeys([*([name] if name else []), *others]))
    return found


@dataclass(frozen=True)
class Launched:
    """An app whose nodes a launch file names: what is behind their names before and after a step.

    `held`: nodes, as the launch file calls them, that begin when those of the version before have ended. `overlap`:
    those of which somebody said that two of them do no harm. `on_demand`: what they have on the graph is their clients'
    wish.
    """

    old: str
    new: str
    held: tuple[str, ...] = ()
    overlap: tuple[str, ...] = ()
    on_demand: bool = False

    def plain(self, node: str) -> str:
        """What the launch file calls a node of the version before."""
        return node.removesuffix(self.old) if self.old else node

    def is_held(self, node: str) -> bool:
        return any(named(word, [self.plain(node)]) for word in self.held)

    def may_overlap(self, node: str) -> bool:
        return any(named(word, [self.plain(node)]) for word in self.overlap)


def launched(before: Object, after: Object, app: App) -> Launched | None:
    """Two versions of an app, of which the later is a launch file; None: it has a node of its own name."""
    if node_of(after):
        return None
    words = [word for one in after["spec"]["template"]["spec"]["containers"] for word in one.get("args") or ()]
    held = tuple(word.removeprefix(_HELD) for word in words if word.startswith(_HELD))
    overlap = app.launch.overlap if app.launch else ()
    return Launched(suffix_of(before), suffix_of(after), held, overlap, on_demand(app))


@dataclass(frozen=True)
class Succession:
    """What is called otherwise after a step: nodes, and topics and services that are private to one."""

    nodes: Mapping[str, str] = field(default_factory=dict)
    names: Mapping[str, str] = field(default_factory=dict)

    @property
    def renames(self) -> dict[str, str]:
        return {**self.nodes, **self.names}

    def __or__(self, other: Succession) -> Succession:
        return Succession({**self.nodes, **other.nodes}, {**self.names, **other.names})


def succession(app: Launched, nodes: Sequence[str], there: Iterable[str]) -> Succession:
    """Of a launch file's nodes; `there` are all topics and services.

    Private ones have the place that others know in every version, but for those that a nodelet manager has for its own
    nodelets.
    """
    new = {node: app.plain(node) + app.new for node in nodes}
    known = set(there)
    names_: dict[str, str] = {}
    for name in known:
        node = owner_of(name, nodes)
        if node:
            own = MANAGER if f"{node}/load_nodelet" in known else LOGGERS
            rest = name[len(node) :]
            names_[name] = (new[node] if rest[1:] in own else app.plain(node)) + rest
    return Succession(new, names_)
