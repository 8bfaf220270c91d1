# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""An app that is taken out of the inventory stays until its removal is asked for, and then leaves nothing behind."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from fleet import Fleet

LIMIT = ("--limit", "robot1,edge1")


@pytest.fixture(autouse=True)
def settled(fleet: Fleet) -> Iterator[None]:
    """What the tests after this one find is what they know."""
    before = fleet.variables
    yield
    if of_spare(fleet):
        fleet.update(before, update_remove_apps=["spare"])
    fleet.accept(before)


def of_spare(fleet: Fleet) -> list[str]:
    """What the cluster has of it, and the parameter server."""
    (asked,) = fleet.pods()["robot1"]["add-two-ints"]
    parameters = fleet.cluster.parameters("robot1", asked.name)
    pods = [name for name, there in fleet.pods()["robot1"].items() if there]
    names = [name.split("/")[-1] for name in fleet.cluster.versions(["robot1"])]
    return sorted(name for name in [*pods, *names, *parameters] if name.startswith("spare"))


@pytest.mark.promise("an app that was taken out is removed without a loss, where that is asked for")
def test_an_app_that_was_taken_out_goes_when_that_is_asked_for(fleet: Fleet) -> None:
    (listener,) = fleet.pods()["robot1"]["temperature-stats"]
    spare: dict[str, Any] = {
        "name": "spare", "image": listener.image, "command": ["/opt/rosops-apps/bin/temperature_subscriber"],
        "env": {"LOG_DIR": "/tmp"}, "placement": "local", "pattern": "pubsub", "params": {"limit": 1},  # noqa: S108 - the pod's own
        "files": [{"path": "/etc/spare.yaml", "content": "a: 1\n"}], "ports": [{"name": "web", "port": 9001}],
    }  # fmt: skip
    run = fleet.update({**fleet.variables, "ros_apps_robot": [spare]}, *LIMIT)
    assert run.status == 0, run
    # the pod, the Deployment, its files, its earlier versions, its parameters
    assert len(of_spare(fleet)) == 5, of_spare(fleet)
    assert [*fleet.cluster.behind("robot1", "spare")] == ["web:9001"]
    without = {name: value for name, value in fleet.variables.items() if name != "ros_apps_robot"}
    before, watch = fleet.running(), fleet.watch()

    run = fleet.update(without, *LIMIT)
    assert (run.status, run.outcomes["robot1"], run.changed) == (0, "unchanged", 0), run
    assert "not in the inventory, left as they are (update_remove_apps takes them away): spare" in run.output
    run = fleet.update(without, *LIMIT, "--check", update_remove_apps=["all"])
    assert (run.status, run.outcomes["robot1"]) == (0, "updated"), run
    fleet.assert_still_running(before)

    run = fleet.update(without, *LIMIT, update_remove_apps=["all"])
    assert (run.status, run.outcomes["robot1"]) == (0, "updated"), run
    assert [step["name"] for step in run.steps("robot1")] == ["spare"], run
    assert of_spare(fleet) == []
    assert fleet.cluster.behind("robot1", "spare") == {}
    watch.assert_nothing_lost("robot1")
    run = fleet.update(without, *LIMIT, update_remove_apps=["all"])
    assert (run.status, run.outcomes["robot1"], run.changed) == (0, "unchanged", 0), run
