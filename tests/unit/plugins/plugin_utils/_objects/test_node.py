# SPDX-License-Identifier: GPL-3.0-or-later
"""Labels and taints of a node."""

from __future__ import annotations

import json
from hashlib import sha256
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
LABEL = "node-restriction.kubernetes.io/rosops-taints"  # that the annotation is our word
BARE = {"key": "bare", "effect": "NoSchedule"}


def node(there: list[dict[str, Any]], recorded: list[dict[str, Any]] | None = None) -> dict[str, Any]:
    text = json.dumps(recorded)
    notes = {} if recorded is None else {"rosops.fleet/taints": text}
    labels = {LABEL: sha256(text.encode()).hexdigest()[:32]} if notes else {}
    return {"metadata": {"resourceVersion": "7", "annotations": notes, "labels": labels}, "spec": {"taints": there}}


def test_labels() -> None:
    placement, of_robot = (f"node-restriction.kubernetes.io/rosops-{name}" for name in ("placement", "robot"))
    edge = node_object("edge1", "remote", "", {})
    assert edge["metadata"]["labels"] == {"deploymentType": "remote", placement: "remote"}
    own = node_object("r", "local", "robot1", {"deploymentType": "mine", of_robot: "r2", "a": "b"})
    ours = {"rosops.fleet/robot": "robot1", placement: "local", of_robot: "robot1"}
    assert own["metadata"]["labels"] == {"deploymentType": "mine", **ours, "a": "b"}


@pytest.mark.parametrize(
    ("before", "wanted", "after"),
    [
        (node([THEIRS]), [OURS], ([THEIRS, OURS], [OURS])),
        (node([THEIRS, OURS], [OURS]), [], ([THEIRS], None)),
        (node([OURS, THEIRS], [OURS]), [OTHER], ([THEIRS, OTHER], [OTHER])),
        (node([OTHER]), [OURS], ([OURS], [OURS])),  # somebody else's of that name
        (node([OURS]), [OURS], ([OURS], [OURS])),  # there, not recorded
        (node([], [OURS]), [OURS], ([OURS], [OURS])),
        (node([]), [{**BARE, "value": ""}], ([BARE], [BARE])),  # an empty value is none
        (node([OURS], [OURS]), [], (None, None)),
        # as it should be
        (node([THEIRS]), [], None),
        (node([OURS, THEIRS], [OURS]), [OURS], None),
        (node([{**BARE, "timeAdded": "x"}], [BARE]), [{**BARE, "value": None}], None),
        ({"metadata": {"resourceVersion": "7"}}, [], None),
    ],
)
def test_changes(before: Any, wanted: Any, after: Any) -> None:
    found: Any = taints_patch(before, wanted)
    if after:
        assert found["metadata"]["resourceVersion"] == "7"
        note = found["metadata"]["annotations"]["rosops.fleet/taints"]
        assert not note or not taints_patch(found, wanted)  # a second time
        found = found["spec"]["taints"], json.loads(note) if note else None
    assert found == after


@pytest.mark.parametrize("written", ["[", "7", '["ours"]', json.dumps([THEIRS])])
def test_what_others_wrote_as_record_of_taints_is_written_anew_and_takes_none_off(written: str) -> None:
    before = node([THEIRS])
    before["metadata"]["annotations"]["rosops.fleet/taints"] = written
    found: Any = taints_patch(before, [OURS])
    assert found["spec"]["taints"] == [THEIRS, OURS]
    assert json.loads(found["metadata"]["annotations"]["rosops.fleet/taints"]) == [OURS]


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
