# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What an update is meant to change: as the apps' specifications say, in names of the graph, and in words. Pure."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence

from ...module_utils._robot.latched import worth_keeping
from ...module_utils._ros.contract import Intended
from ...module_utils._ros.graph import Graph, names_of
from ...module_utils._ros.names import matches, resolve
from .._model import context
from .._model.app import App
from .._model.context import Robot

# Whether the keeper keeps it.
LATCHED = {
    True: "is given to later subscribers by the keeper until the next version says something",
    False: "goes with it",
}
# What these have on the graph is their clients' wish, and the clients come to a pod once it is ready.
_ON_DEMAND = re.compile(r"\b(rosbridge_(server|websocket|tcp|udp)|foxglove_bridge|web_video_server)\b")


def on_demand(app: App) -> bool:
    """Whether the app subscribes and publishes as its clients ask, known by its command."""
    launched = (app.launch.package, *app.launch.file) if app.launch else ()
    return any(_ON_DEMAND.search(word) for word in (*app.command, *app.args, *launched))


def intended(apps: Collection[App], robot: Robot, old_nodes: Mapping[str, str], back: bool = False) -> Intended:
    """Of all apps of a step together: it is one change. `back`: to the version before, so names move back, too."""
    ignore: list[str] = []
    renamed: dict[str, str] = {}
    rates: dict[str, float] = {}
    nodes: list[str] = []
    for app in apps:
        stable, update = context.graph_node(app, robot), app.update
        namespace, node = context.graph_namespace(app, robot), old_nodes.get(app.name) or stable

        def full(name: str, app: App = app, namespace: str = namespace, node: str = node) -> str:
            kept = name.startswith("~") and name[1:].lstrip("/") in app.private_names
            return resolve(name, namespace, context.graph_node(app, robot) if kept else node)

        ignore += [full(name) for name in update.ignore]
        renamed |= {full(before): full(after) for before, after in update.renamed.items()}
        rates |= {full(name): float(hz) for name, hz in update.rates.items()}
        nodes += [node] if on_demand(app) else []
    if back:
        renamed = {after: before for before, after in renamed.items()}
    keeps = robot.master.mode != "external" and all(app.hooks != "none" for app in apps)
    return Intended(tuple(ignore), renamed, rates, tuple(nodes), keeps)


def allowed(graph: Graph, nodes: Sequence[str], wanted: Intended) -> list[str]:
    """What a step of these nodes (as they are called now) would allow, in words; what nobody has now is not told."""
    own = set(nodes)
    topics = {
        name: topic
        for name, topic in sorted(graph.topics.items())
        if own & {*names_of((*topic.publishers, *topic.subscribers))}
    }
    services = {name for name, one in graph.services.items() if own & {one.said.provider, *names_of(one.providers)}}
    actions = {name for name, action in graph.actions.items() if own & {*names_of(action.servers)}}
    there = [*topics, *sorted(services), *sorted(actions)]
    found = [f"{name} may be missing or of another type" for name in there if matches(name, wanted.ignore)]
    found += [
        f"{before} has to be {after} then"
        for before, after in wanted.renamed.items()
        if any(name == before or name.startswith(f"{before}/") for name in there)
    ]
    for name, topic in topics.items():
        hz = wanted.rate(wanted.renamed.get(name, name))
        was = [rate for key, rate in topic.rates.items() if key.name in own and rate]
        if hz is not None:
            carried = f" (now {max(was):g} Hz)" if was else ""
            found.append(f"{name} may carry {'any rate' if not hz else f'{hz:g} Hz or more'}{carried}")
    found += [f"{node} may have other topics and services: its clients ask for them" for node in wanted.on_demand]
    for node in nodes:
        latched = [name for name, topic in topics.items() if node in names_of(topic.latched)]
        heard = [name for name, topic in topics.items() if node in names_of(topic.subscribers)]
        found += [f"what {node} latched on {name} {LATCHED[wanted.keeps]}" for name in worth_keeping(latched, heard)]
    return found
