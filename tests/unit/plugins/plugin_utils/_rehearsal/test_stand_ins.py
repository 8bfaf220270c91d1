# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What stand-ins are told to play."""

from __future__ import annotations

import json

from ansible_collections.rosops.fleet.plugins.module_utils._pod.stand_in import blank, number_at
from ansible_collections.rosops.fleet.plugins.module_utils._ros.layout import Place
from ansible_collections.rosops.fleet.plugins.plugin_utils._rehearsal.stand_ins import plan
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._rehearsal.recordings import RECORDING


def test_a_publisher_with_a_number_that_the_program_finds_again() -> None:
    [node] = plan(RECORDING, ["/temperature"]).nodes
    [topic] = node.publishes
    assert (topic.name, topic.type, topic.md5sum, topic.rate, topic.latched) == (
        "/temperature", "demo/Temperature", "aa", 500.0, False
    )  # fmt: skip
    assert topic.definition == RECORDING.topics["/temperature"].definition
    assert (topic.size, topic.place) == (32, Place((4, 8, -1), "Q", own=False))
    told = json.loads(json.dumps(plan(RECORDING, ["/temperature"]).as_dict()))["nodes"][0]["publishes"][0]
    assert number_at(blank(told["size"], told["place"], 77), told["place"]) == 77


def test_subscribers_services_and_what_is_latched() -> None:
    stats, helper = plan(RECORDING, ["/temperature_stats", "/arm/helper"]).nodes
    assert [(one.name, one.md5sum, one.place) for one in stats.subscribes] == [
        ("/temperature", "aa", Place((4, 8, -1), "Q", own=False))
    ]
    [latched] = stats.publishes
    assert (latched.name, latched.latched, latched.rate, latched.size) == ("/map", True, 0.0, 4)
    assert [(one.name, one.type, one.md5sum) for one in helper.services] == [("/home", "demo/Home", "ee")]
    [status] = helper.publishes
    assert (status.name, status.rate) == ("/work/status", 5.0)  # nobody listened to it


def test_the_first_node_greets_what_is_to_be_greeted() -> None:
    stats, helper = plan(RECORDING, ["/temperature_stats", "/arm/helper"], ["/sum"]).nodes
    assert (stats.asks, helper.asks) == (("/sum",), ())


def test_nobody_sends_goals_of_zeros() -> None:
    [loner] = plan(RECORDING, ["/loner"]).nodes
    rates = {one.name: one.rate for one in loner.publishes}
    assert rates == {"/odd": 1.0, "/work/goal": 0.0}


def test_a_type_that_nobody_has_defined_is_sent_without_bytes() -> None:
    [loner] = plan(RECORDING, ["/loner"]).nodes
    [odd] = [one for one in loner.publishes if one.name == "/odd"]
    assert (odd.size, odd.place, odd.md5sum) == (0, None, "cc")
    [unknown] = loner.subscribes
    assert (unknown.type, unknown.md5sum, unknown.place) == ("demo/Unknown", "", None)
