# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Places of a graph: from left to right, in its bands, nothing over anything else."""

from __future__ import annotations

from itertools import combinations, pairwise
from typing import Any

from ansible_collections.rosops.fleet.plugins.plugin_utils._report.layout import Layout, Vertex, layout

BOX = Vertex("robot", 100, 30)


def of(edges: str, edge: str = "") -> Layout:
    """`a>b b>c`; the vertices in `edge` are at the edge."""
    pairs: list[Any] = [tuple((name,) for name in pair.split(">")) for pair in edges.split()]
    names = sorted({name for pair in pairs for name in pair})
    vertices = {name: Vertex("edge", 100, 30) if name[0] in edge.split() else BOX for name in names}
    return layout(vertices, pairs, ["robot", "edge"])


def test_messages_go_from_left_to_right() -> None:
    made = of("a>b b>c a>c d>c")
    x = {name[0]: place[0] for name, place in made.at.items() if len(name) == 1}
    assert x["a"] < x["b"] < x["c"]
    assert x["d"] == x["b"]  # nothing leads to it, so it stands beside what it leads to
    ends = {edge: (points[0], points[-1]) for edge, points in made.paths.items()}
    assert ends[("a",), ("b",)] == ((x["a"] + 50, made.at[("a",)][1]), (x["b"] - 50, made.at[("b",)][1]))


def test_a_way_over_several_layers_has_a_place_in_each() -> None:
    made = of("a>b b>c a>c")
    long = made.paths[("a",), ("c",)]
    assert len(long) == 4
    assert abs(long[1][1] - made.at[("b",)][1]) >= 15 + 5  # past the box, not through it


def test_a_cycle_is_cut_once() -> None:
    made = of("a>b b>c c>a")
    x = [made.at[name,][0] for name in "abc"]
    assert sum(one < other for one, other in pairwise([*x, x[0]])) == 2
    assert len(made.paths) == 3


def test_one_that_leads_to_itself() -> None:
    assert len(of("a>a a>b").paths) == 2


def test_bands_stand_below_each_other_and_hold_their_own() -> None:
    made = of("a>b b>c a>d", edge="b d")
    (top, height), (below, _height) = made.bands["robot"], made.bands["edge"]
    assert below >= top + height
    assert all((made.at[name,][1] > below) == (name in "bd") for name in "abcd")
    assert made.height >= below


def test_nothing_lies_over_anything_else() -> None:
    edges = " ".join(f"{one}>{other}" for one, other in combinations("abcdefgh", 2) if (ord(one) + ord(other)) % 3)
    made = of(edges, edge="c g h")
    for (_one, (x, y)), (_other, (to_x, to_y)) in combinations(made.at.items(), 2):
        assert x != to_x or abs(y - to_y) >= 10
    assert all(50 <= x <= made.width - 50 and 0 < y < made.height for x, y in made.at.values())


def test_nothing_at_all() -> None:
    assert layout({}, [], []).at == {}
