# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
from __future__ import annotations

import json

from ansible_collections.rosops.fleet.plugins.filter import update_events, update_step_id

STARTED = 1795252087.347614
STEP = {"name": "a", "apps": ["a"], "handoff": "overlap", "outcome": "updated", "started": STARTED}


def test_an_event_has_the_id_that_the_step_was_given() -> None:
    made = update_events.FilterModule().filters()["update_events"]([STEP], "robot1")
    [event] = json.loads(made["data"]["updates.json"])["updates"]
    assert event["id"] == update_step_id.FilterModule().filters()["update_step_id"]("robot1", ["a"], str(STARTED))
