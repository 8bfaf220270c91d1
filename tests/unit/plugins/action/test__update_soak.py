# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Between two waves: who waits, and for which versions; the waiting itself is in _update/test_soaking."""

from __future__ import annotations

from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.action import _update_soak
from ansible_collections.rosops.fleet.plugins.action._update_soak import is_last_wave, revisions
from ansible_collections.rosops.fleet.tests.unit.plugins.action.actions import run

NOWHERE = {"kubeconfig": "/nowhere/edge.yaml"}
WAVES = {"ansible_play_hosts_all": ["r3", "r1", "r2"]}
STEP = {
    "id": "x", "name": "camera", "apps": ["camera"], "handoff": "overlap", "started": 1.0, "phases": {}, "reason": "",
    "outcome": "updated", "from": {}, "to": {"camera": {"image": "x/camera:2", "revision": "rev2"}},
}  # fmt: skip
UPDATED = {"outcome": "updated", "reason": "", "steps": [STEP]}


def test_waves_are_taken_in_the_order_of_names() -> None:
    assert not is_last_wave({**WAVES, "ansible_play_batch": ["r1", "r2"]})
    assert is_last_wave({**WAVES, "ansible_play_batch": ["r3"]})


@pytest.mark.parametrize(
    ("told", "batch"),
    [
        ({"outcome": UPDATED}, ["r3"]),  # the last wave
        ({"outcome": {**UPDATED, "outcome": "rolled-back"}}, ["r1"]),
        ({"at_work": True}, ["r1"]),  # only looked at
    ],
)
def test_what_need_not_be_waited_for_is_handed_on_as_it_is(told: dict[str, Any], batch: list[str]) -> None:
    known = {**WAVES, "inventory_hostname": batch[0], "ansible_play_batch": batch, "update_result": told}
    result = run(_update_soak, NOWHERE, known)
    assert {key: value for key, value in result.items() if key in ("changed", *told)} == {"changed": False, **told}


def test_new_is_what_the_steps_brought() -> None:
    assert revisions(UPDATED) == {"camera": "rev2"}
