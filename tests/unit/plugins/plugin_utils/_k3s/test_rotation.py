# SPDX-License-Identifier: GPL-3.0-or-later
"""Which certificates were renewed, and what is told of them."""

from __future__ import annotations

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import NotReadyError, SpecError
from ansible_collections.rosops.fleet.plugins.plugin_utils._k3s.rotation import lives, renewed, told

OLD, NEW = "2027-03-01T08:00:00", "2027-11-26T08:00:00"
NODE, ADMIN, STAYS = "agent/client-kubelet.crt", "server/tls/client-admin.crt", "server/tls/other.crt"


def test_those_that_end_later_are_told_by_name_and_end() -> None:
    found = renewed(lives({NODE: [OLD, NEW], ADMIN: [OLD, NEW], STAYS: [OLD, OLD]}))
    assert told(found) == f"until 2027-11-26 (before: 2027-03-01): {NODE}, {ADMIN}"


@pytest.mark.parametrize("ends", [{}, {NODE: [OLD, OLD]}, {NODE: [NEW, OLD]}, {ADMIN: [OLD, NEW]}])
def test_without_a_new_one_of_the_node_nothing_was_renewed(ends: dict[str, list[str]]) -> None:
    with pytest.raises(NotReadyError, match=r"client-kubelet.crt is no other one than before, or ends no later"):
        renewed(lives(ends))


def test_those_that_are_there_are_told_by_their_ends() -> None:
    assert told(lives({NODE: [OLD, OLD], ADMIN: [NEW, NEW]})) == f"until 2027-03-01: {NODE}; until 2027-11-26: {ADMIN}"


@pytest.mark.parametrize("said", [None, [], {NODE: "x"}, {NODE: [OLD]}, {NODE: [OLD, "2027-11-26"]}, {NODE: [OLD, 7]}])
def test_what_makes_no_sense_is_refused(said: object) -> None:
    with pytest.raises(SpecError):
        lives(said)  # type: ignore[arg-type]


def test_a_name_that_is_none_is_left_out() -> None:
    assert lives({"../x": [OLD, NEW], "\x1b[31mred": [OLD, NEW]}) == {}
