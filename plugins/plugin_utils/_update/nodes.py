# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which nodes of the ROS graph are an app's: the one of its name, and all others that its pod started. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from urllib.parse import urlsplit

from ansible_collections.rosops.fleet.plugins.module_utils._ros.contract import is_tool
from ansible_collections.rosops.fleet.plugins.plugin_utils._model import names
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.world import Graph, Object


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
    at = {node: urlsplit(entry.get("uri") or "").hostname or "" for node, entry in sorted(graph["nodes"].items())}
    found = {}
    for app, name in named.items():
        others = [node for node, address in at.items() if apps_at.get(address) == {app} and not is_tool(node)]
        found[app] = list(dict.fromkeys([*([name] if name else []), *others]))
    return found
