# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Labels and taints of a node. Pure."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

from ansible_collections.rosops.fleet.plugins.plugin_utils._model import names
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.common import Object

# spec.taints is one atomic list that Kubernetes writes to as well (not-ready, unreachable, pressure), so it cannot be
# applied as a whole. An annotation says which of the taints are ours.
TAINTS_ANNOTATION = "rosops.fleet/taints"


def node_object(name: str, placement: str, robot: str, labels: Mapping[str, Any]) -> Object:
    """What is applied to a node: its placement, its robot (empty: an edge host's node) and further labels."""
    own = {names.LABEL_PLACEMENT: placement, **({names.LABEL_ROBOT: robot} if robot else {})}
    return {"apiVersion": "v1", "kind": "Node", "metadata": {"name": name, "labels": {**own, **labels}}}


def taints_patch(node: Mapping[str, Any], taints: Sequence[Mapping[str, Any]]) -> Object | None:
    """The merge patch that gives a node, as the API shows it, exactly these taints beside those of others.

    None if it has them. A taint of ours that is no longer wanted goes; one of others stays, unless one is wanted that
    Kubernetes takes for the same (key and effect). The patch holds for this version of the node only.
    """
    wanted = [{key: value for key, value in taint.items() if value not in ("", None)} for taint in taints]
    there = list((node.get("spec") or {}).get("taints") or [])
    recorded = json.loads((node["metadata"].get("annotations") or {}).get(TAINTS_ANNOTATION) or "[]")
    ours, places = [_whole(taint) for taint in recorded], [_place(taint) for taint in wanted]
    same = [_whole(taint) for taint in wanted]
    kept = [
        taint for taint in there if _whole(taint) in same or (_whole(taint) not in ours and _place(taint) not in places)
    ]
    has = [_whole(taint) for taint in kept]
    after = [*kept, *(taint for taint in wanted if _whole(taint) not in has)]
    if after == there and recorded == wanted:
        return None
    annotation = json.dumps(wanted) if wanted else None
    version = node["metadata"]["resourceVersion"]
    return {
        "metadata": {"resourceVersion": version, "annotations": {TAINTS_ANNOTATION: annotation}},
        "spec": {"taints": after or None},
    }


def _whole(taint: Mapping[str, Any]) -> tuple[str, str, str]:
    return (str(taint["key"]), str(taint.get("value") or ""), str(taint["effect"]))


def _place(taint: Mapping[str, Any]) -> tuple[str, str]:
    return (str(taint["key"]), str(taint["effect"]))
