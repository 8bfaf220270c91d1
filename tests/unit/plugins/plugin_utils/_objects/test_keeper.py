# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
from __future__ import annotations

from typing import Any

from ansible_collections.rosops.fleet.plugins.module_utils._robot.main import options
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.keeper import keeper_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.master import master_objects
from ansible_collections.rosops.fleet.tests.unit.robots import robot


def objects(**master: Any) -> list[dict[str, Any]]:
    return keeper_objects(robot(name="r1", master=master))


def test_the_masters_overrides_are_not_the_keepers() -> None:
    """Nor does a change of the master restart it: it is there to outlive that."""
    overrides = {"spec": {"template": {"spec": {"hostNetwork": True}}}}
    assert objects(overrides=overrides) == objects()
    both = master_objects(robot(name="r1", master={"overrides": overrides}))
    assert [(item["kind"], item["metadata"]["name"]) for item in both] == [
        ("Deployment", "ros-master"),
        ("Service", "ros-master"),
        ("Deployment", "ros-keeper"),
        ("Service", "ros-keeper"),
    ]
    assert "hostNetwork" in both[0]["spec"]["template"]["spec"]


def test_goal_forwarding_is_switched_off_by_a_word_of_its_command() -> None:
    on, off = (objects(goal_forwarding=word)[0]["spec"]["template"]["spec"]["containers"][0] for word in (True, False))
    assert on == objects()[0]["spec"]["template"]["spec"]["containers"][0]
    assert off == {**on, "command": [*on["command"], "--goal-forwarding", "off"]}
    words = off["command"][off["command"].index("keeper") + 1 :]
    assert options(words)["--goal-forwarding"] == "off"
