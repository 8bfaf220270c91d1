# SPDX-License-Identifier: GPL-3.0-or-later
"""The edge host is lost and made anew: its robots are agents of a cluster that is gone."""

from __future__ import annotations

import pytest
from fleet import ROBOTS, Fleet


@pytest.mark.promise("robots of an edge that was made anew work on until they are named, and one run brings them back")
@pytest.mark.long
def test_an_edge_that_was_made_anew_has_its_robots_back_by_name(fleet: Fleet) -> None:
    pods = [(robot, pod.uid) for robot, apps in fleet.pods().items() for pod in apps["temperature"]]
    before = [fleet.hosts.processes(*pod) for pod in pods]
    fleet.playbooks.run("reset", {**fleet.variables, "reset_confirm": True}, "--limit", "edge1").must(0)
    fleet.playbooks.run("site", fleet.variables, "--limit", "edge1").must(0)
    refused = fleet.playbooks.run("site", fleet.variables).must(2, **dict.fromkeys(ROBOTS, "failed"))
    for robot in ROBOTS:
        assert f"is gone for good, -e k3s_enrol={robot} has" in refused.host(robot)["reason"], refused
    assert [fleet.hosts.processes(*pod) for pod in pods] == before
    named = fleet.playbooks.run("site", {**fleet.variables, "k3s_enrol": ",".join(ROBOTS)})
    named.must(0, **dict.fromkeys(ROBOTS, "updated"))
    fleet.playbooks.run("site", fleet.variables).must_change_nothing()
    fleet.connect()
    fleet.wait_settled()
    fleet.accept(fleet.variables)
    fleet.figures.append(f"{len(ROBOTS)} robots at work in a new cluster after {named.ended - named.began:.0f} s")
