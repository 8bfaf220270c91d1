# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What somebody changed by hand: what is suspected, and what is none of it."""

from __future__ import annotations

import copy
from collections.abc import Callable
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._model import names
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.drift import suspects
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.plan import wanted_deployments
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._update.update_objects import app, applied
from ansible_collections.rosops.fleet.tests.unit.robots import robot

ROBOT = robot(app("sensor", resources={"limits": {"cpu": "1000m"}}, env={"A": "1", "EMPTY": ""}))


def found(change: Callable[[dict[str, Any]], Any]) -> list[str]:
    live = copy.deepcopy(applied(ROBOT).deployments)
    sensor = next(item for item in live if item["metadata"]["name"] == "sensor")
    change(sensor)  # type: ignore[arg-type]
    return [item["metadata"]["name"] for item in suspects(wanted_deployments(ROBOT), live)]


def container(item: dict[str, Any]) -> dict[str, Any]:
    found: dict[str, Any] = item["spec"]["template"]["spec"]["containers"][0]
    return found


@pytest.mark.parametrize(
    "change",
    [
        lambda item: item["spec"].update(replicas=0),
        lambda item: container(item).update(image="x.org/by-hand:1"),
        lambda item: container(item).update(args=["other"]),
        lambda item: container(item)["env"].pop(0),
        lambda item: container(item)["env"][-1].update(value="other"),
        lambda item: container(item).pop("volumeMounts"),
    ],
)
def test_what_was_changed_by_hand_is_suspected(change: Callable[[dict[str, Any]], Any]) -> None:
    assert found(change) == ["sensor"]


@pytest.mark.parametrize(
    "change",
    [
        lambda item: item.update(status={}),
        lambda item: container(item).update(terminationMessagePath="/dev/termination-log"),
        lambda item: container(item)["env"].append({"name": "INJECTED", "value": "1"}),
        lambda item: [one.pop("value") for one in container(item)["env"] if one.get("value") == ""],
        lambda item: item["metadata"]["annotations"].update({names.ANNOTATION_HASH: "another version"}),
        lambda item: (
            item["spec"].update(replicas=0),
            item["metadata"]["annotations"].update({names.ANNOTATION_UPDATING: "1"}),
        ),
    ],
)
def test_defaults_and_what_others_add_are_not(change: Callable[[dict[str, Any]], Any]) -> None:
    assert found(change) == []
