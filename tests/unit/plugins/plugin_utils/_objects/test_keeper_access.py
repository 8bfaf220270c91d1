# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
from __future__ import annotations

from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.keeper import keeper_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.namespace import namespace_objects
from ansible_collections.rosops.fleet.tests.unit.robots import robot


def places(objects: list[dict[str, Any]]) -> list[tuple[str, str, str]]:
    return [(one["kind"], one["metadata"].get("namespace", ""), one["metadata"]["name"]) for one in objects]


@pytest.mark.parametrize("mode", ["robot", "shared"])
def test_it_is_there_before_the_pod_that_needs_it(mode: str) -> None:
    """A pod without its account is not made; the namespace is applied before everything else of a robot."""
    made = robot(name="r1", master={"mode": mode})
    deployment = keeper_objects(made)[0]
    pod = deployment["spec"]["template"]["spec"]
    account = ("ServiceAccount", deployment["metadata"]["namespace"], pod["serviceAccountName"])
    objects = namespace_objects(made)
    assert account in places([one for one in objects if one["kind"] != "Namespace"])
    assert pod["automountServiceAccountToken"] is True
    spaces = [one["metadata"]["name"] for one in objects if one["kind"] == "Namespace"]
    inside = [one for one in objects if one["kind"] != "Namespace" and not one["kind"].startswith("ClusterRole")]
    assert {one["metadata"]["namespace"] for one in inside} <= set(spaces)
    assert objects[0]["kind"] == "Namespace"
