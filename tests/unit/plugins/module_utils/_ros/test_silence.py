# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""For how long nodes have been silent, look by look."""

from __future__ import annotations

from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph import PATIENCE, Graph, Node
from ansible_collections.rosops.fleet.plugins.module_utils._ros.silence import Silence

LATE, UP = Node("/a", asked=True, error="no answer"), Node("/a", pid=7, asked=True)
REFUSES, UNASKED = Node("/a", asked=True, refused=True), Node("/a")


class Looks:
    def __init__(self) -> None:
        self.at = 0.0
        self.silence = Silence(lambda: self.at)

    def __call__(self, node: Node, began: float, seconds: float = 0.0) -> Node:
        self.at = began + seconds
        return self.silence.noted(Graph({node.key: node}), began).node("/a")


def test_silence_begins_when_it_was_asked_and_any_answer_ends_it() -> None:
    look = Looks()
    assert [look(LATE, 0.0, 2.0).silent, look(LATE, 2.0, 2.0).silent] == [2.0, 4.0]
    assert look(UP, 4.0) == UP
    assert look(LATE, 6.0, 2.0).silent == 2.0
    assert not look(LATE, 6.0 + PATIENCE - 0.1).gone
    assert look(LATE, 6.0 + PATIENCE).gone


def test_whoever_was_not_asked_meanwhile_begins_anew() -> None:
    """It was connected then, so nobody had a reason to ask."""
    look = Looks()
    look(LATE, 0.0)
    assert look(UNASKED, 3.0) == UNASKED
    assert look(LATE, PATIENCE + 1).silent == 0.0


def test_a_closed_port_needs_no_patience() -> None:
    assert Looks()(REFUSES, 0.0).gone
    assert not UNASKED.gone
    assert not UP.gone
