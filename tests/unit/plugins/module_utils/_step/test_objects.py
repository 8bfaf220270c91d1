# SPDX-License-Identifier: GPL-3.0-or-later

"""The Lease as it is written."""

from __future__ import annotations

from ansible_collections.rosops.fleet.plugins.module_utils._step.objects import lease_with

FOUND = {
    "metadata": {"name": "robot-update", "resourceVersion": "7"},
    "spec": {"holderIdentity": "host 77", "leaseTransitions": 3, "acquireTime": "before"},
}


def test_it_is_written_as_electors_do() -> None:
    made = lease_with("me", {"metadata": {"name": "robot-update"}}, "me", 15, "T1")
    assert made["metadata"] == {"name": "robot-update"}
    spec = {"holderIdentity": "me", "leaseDurationSeconds": 15, "renewTime": "T1", "acquireTime": "T1"}
    assert made["spec"] == {**spec, "leaseTransitions": 0}
    taken = lease_with("me", FOUND, "me", 15, "T2")
    assert taken["metadata"]["resourceVersion"] == "7"
    assert (taken["spec"]["acquireTime"], taken["spec"]["leaseTransitions"]) == ("T2", 4)
    let_go = lease_with("", taken, "me", 15, "T3")
    assert [let_go["spec"][key] for key in ("holderIdentity", "acquireTime", "leaseTransitions")] == ["", "T2", 4]
