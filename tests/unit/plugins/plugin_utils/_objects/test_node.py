# SPDX-License-Identifier: GPL-3.0-or-later
"""Labels and taints of a node."""

from __future__ import annotations

import json
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.node import (
    evicted,
    evicting,
    node_object,
    taints_patch,
    unplaced,
)

OURS = {"key": "ours", "value": "a", "effect": "NoSchedule"}
OTHER = {"key": "ours", "value": "b", "effect": "NoSchedule"}  # for Kubernetes the same taint with another value
THEIRS = {"key": "node.kubernetes.io/not-ready", "effect": "NoExecute", "timeAdded": "2026-01-01T00:00:00Z"}
BARE = {"key": "bare", "effect": "NoSchedule"}


def node(there: list[dict[str, Any]], recorded: list[dict[str, Any]] | None = None) -> dict[str, Any]:
    notes = {} if recorded is None else {"rosops.fleet/taints": json.dumps(recorded)}
    return {"metadata": {"resourceVersion": "7", "annotations": notes}, "spec": {"taints": there}}


def test_labels() -> None:
    placement, of_robot = (f"node-restriction.kubernetes.io/rosops-{name}" for name in ("placement", "robot"))
    labels = node_object("edge1", "remote", "", {})["metadata"]["labels"]
    assert labels == {"deploymentType": "remote", placement: "remote"}
    labels = node_object("r", "local", "robot1", {"deploymentType": "mine", of_robot: "r2", "a": "b"})["metadata"][
        "labels"
    ]
    ours = {placement: "local", of_robot: "robot1"}
    assert labels == {"deploymentType": "mine", "rosops.fleet/robot": "robot1", **ours, "a": "b"}


CASES = [
    ("new", node([THEIRS]), [OURS], [THEIRS, OURS], [OURS]),
    ("taken out", node([THEIRS, OURS], [OURS]), [], [THEIRS], None),
    ("another value", node([OURS, THEIRS], [OURS]), [OTHER], [THEIRS, OTHER], [OTHER]),
    ("somebody else's of that name", node([OTHER]), [OURS], [OURS], [OURS]),
    ("there, not recorded", node([OURS]), [OURS], [OURS], [OURS]),
    ("recorded, not there", node([], [OURS]), [OURS], [OURS], [OURS]),
    ("an empty value is none", node([]), [{**BARE, "value": ""}], [BARE], [BARE]),
    ("the last one goes", node([OURS], [OURS]), [], None, None),
]


@pytest.mark.parametrize(
    ("before", "wanted", "taints", "recorded"), [case[1:] for case in CASES], ids=[c[0] for c in CASES]
)
def test_changes(before: Any, wanted: Any, taints: Any, recorded: Any) -> None:
    patch = taints_patch(before, wanted)
    assert patch is not None
    assert patch["spec"]["taints"] == taints
    assert patch["metadata"]["resourceVersion"] == "7"
    note = patch["metadata"]["annotations"]["rosops.fleet/taints"]
    assert (json.loads(note) if note else None) == recorded


@pytest.mark.parametrize(
    ("before", "wanted"),
    [
        (node([THEIRS]), []),
        (node([OURS, THEIRS], [OURS]), [OURS]),
        (node([{**BARE, "timeAdded": "x"}], [BARE]), [{**BARE, "value": None}]),
        ({"metadata": {"resourceVersion": "7"}}, []),
    ],
)
def test_as_it_should_be(before: Any, wanted: Any) -> None:
    assert taints_patch(before, wanted) is None


ENDS = {"key": "ours", "value": "a", "effect": "NoExecute"}


def pod(**spec: Any) -> dict[str, Any]:
    return {"metadata": {"namespace": "r", "name": "p"}, "spec": spec}


def test_only_new_taints_that_end_pods_count() -> None:
    assert evicting(node([]), [OURS, ENDS]) == [ENDS]
    assert evicting(node([ENDS]), [ENDS]) == []
    assert evicting(node([{**ENDS, "value": "b"}]), [ENDS]) == [ENDS]


@pytest.mark.parametrize(
    ("toleration", "stays"),
    [
        ({"operator": "Exists"}, True),
        ({"key": "ours", "operator": "Exists"}, True),
        ({"key": "ours", "operator": "Exists", "effect": "NoExecute"}, True),
        ({"key": "ours", "value": "a"}, True),
        ({"key": "ours", "operator": "Equal", "value": "a", "effect": "NoExecute"}, True),
        ({"key": "ours", "value": "b"}, False),
        ({"key": "other", "operator": "Exists"}, False),
        ({"key": "ours", "operator": "Exists", "effect": "NoSchedule"}, False),
        ({"operator": "Exists", "tolerationSeconds": 300}, False),
    ],
)
def test_who_is_evicted(toleration: dict[str, Any], stays: bool) -> None:
    assert evicted([pod(tolerations=[toleration])], [ENDS]) == ([] if stays else ["r/p"])
    assert evicted([pod(tolerations=[toleration])], [ENDS, {"key": "x", "effect": "NoExecute"}]) == (
        [] if toleration == {"operator": "Exists"} else ["r/p"]
    )


def test_who_loses_its_node() -> None:
    selects = pod(nodeSelector={"deploymentType": "local"})
    before = {"deploymentType": "local", "a": "b"}
    assert unplaced([selects, pod()], before, {"deploymentType": "remote", "a": "b"}) == ["r/p"]
    assert unplaced([selects, pod()], before, {"deploymentType": "local"}) == []
