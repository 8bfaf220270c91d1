# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Places for a directed graph whose vertices belong to bands: messages go from left to right. Pure.

By layers, as Sugiyama does it: a cycle is cut, a vertex stands to the right of all that lead to it, an edge over
several layers gets a place in each of them, and what is connected is brought close together.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

V = tuple[Any, ...]  # what a vertex is known by
Point = tuple[float, float]
GAP = 46  # between two layers
MARGIN = 12
BAND_HEAD = 24
ROW_GAP = 8
THROUGH = 10  # the height of an edge that passes
SWEEPS = 6
END: V = ()  # no vertex


@dataclass(frozen=True)
class Vertex:
    """`layer` is the least one that it may stand in."""

    band: str
    width: int
    height: int
    layer: int = 0


@dataclass
class Layout:
    """`at` has the middle of each vertex, `paths` the points of each edge, `bands` top and height of each."""

    width: int = 0
    height: int = 0
    at: dict[V, Point] = field(default_factory=dict)
    paths: dict[tuple[V, V], list[Point]] = field(default_factory=dict)
    bands: dict[str, Point] = field(default_factory=dict)


def layout(vertices: Mapping[V, Vertex], edges: Sequence[tuple[V, V]], bands: Sequence[str]) -> Layout:
    """`bands` stand below each other in this order."""
    forward = _acyclic(vertices, edges)
    layers = _layers(vertices, forward)
    placed = dict(vertices)
    chains = _chains(placed, layers, forward)
    columns = _ordered(placed, layers, chains, bands)
    return _measured(placed, edges, chains, columns, bands)


def _acyclic(vertices: Iterable[V], edges: Sequence[tuple[V, V]]) -> list[tuple[V, V]]:
    """The edges without those that would lead back."""
    following: dict[V, list[V]] = {vertex: [] for vertex in vertices}
    for tail, head in edges:
        following[tail].append(head)
    kept, state = [], dict.fromkeys(following, 0)  # 1: on the way down, 2: done
    led_to = Counter(head for _tail, head in edges)
    # from where more leads away than comes in: then what is cut is what leads back
    for root, heads in sorted(following.items(), key=lambda item: led_to[item[0]] - len(item[1])):
        way = [] if state[root] else [(root, iter(heads))]
        state[root] = state[root] or 1
        while way:
            vertex, rest = way[-1]
            head = next(rest, END)
            if head == END:
                state[vertex] = 2
                way.pop()
                continue
            if state[head] != 1:
                kept.append((vertex, head))
            if state[head] == 0:
                state[head] = 1
                way.append((head, iter(following[head])))
    return kept


def _layers(vertices: Mapping[V, Vertex], edges: Sequence[tuple[V, V]]) -> dict[V, int]:
    """The longest way to each; one that nothing leads to stands close to what it leads to."""
    layers = {name: vertex.layer for name, vertex in vertices.items()}
    for _round in vertices:
        moved = [(head, layers[tail] + 1) for tail, head in edges if layers[head] <= layers[tail]]
        if not moved:
            break
        for head, layer in moved:
            layers[head] = max(layers[head], layer)
    heads = {head for _tail, head in edges}
    for name in vertices:
        nearest = [layers[head] for tail, head in edges if tail == name]
        if name not in heads and nearest:
            layers[name] = max(layers[name], min(nearest) - 1)
    return layers


def _chains(placed: dict[V, Vertex], layers: dict[V, int], edges: Iterable[tuple[V, V]]) -> dict[tuple[V, V], list[V]]:
    """The vertices that each edge passes. Those to one side of the same vertex share their way."""
    chains: dict[tuple[V, V], list[V]] = {}
    for tail, head in edges:
        chain = [tail]
        for layer in range(layers[tail] + 1, layers[head]):
            through = ("through", tail, layer)
            placed[through] = Vertex(placed[tail].band, 0, THROUGH)
            layers[through] = layer
            chain.append(through)
        chains[tail, head] = [*chain, head]
    return chains


def _ordered(
    placed: Mapping[V, Vertex],
    layers: Mapping[V, int],
    chains: Mapping[tuple[V, V], Sequence[V]],
    bands: Sequence[str],
) -> list[list[V]]:
    """Each layer from top to bottom, by bands, and in a band by where the neighbours are."""
    rank = {band: number for number, band in enumerate(bands)}
    columns: list[list[V]] = [[] for _layer in range(max(layers.values(), default=-1) + 1)]
    for name in placed:
        columns[layers[name]].append(name)
    beside: dict[V, set[V]] = {name: set() for name in placed}
    for chain in chains.values():
        for one, other in pairwise(chain):
            beside[one].add(other)
            beside[other].add(one)
    place = {name: float(number) for column in columns for number, name in enumerate(column)}
    for sweep in range(SWEEPS):
        for column in columns if sweep % 2 == 0 else reversed(columns):
            means = {
                name: sum(place[other] for other in near) / len(near) if (near := beside[name]) else place[name]
                for name in column
            }
            column.sort(key=lambda name: (rank[placed[name].band], means[name]))
            place.update({name: float(number) for number, name in enumerate(column)})
    return columns


def _measured(
    placed: Mapping[V, Vertex],
    edges: Iterable[tuple[V, V]],
    chains: Mapping[tuple[V, V], Sequence[V]],
    columns: Sequence[Sequence[V]],
    bands: Sequence[str],
) -> Layout:
    made = Layout()
    widths = [max((placed[name].width for name in column), default=0) for column in columns]
    lefts = [MARGIN + sum(widths[:number]) + number * GAP for number in range(len(widths))]
    made.width = round(MARGIN * 2 + sum(widths) + GAP * max(len(widths) - 1, 0))
    top = float(MARGIN)
    for band in bands:
        stacks = [[name for name in column if placed[name].band == band] for column in columns]
        tall = [sum(placed[name].height + ROW_GAP for name in stack) for stack in stacks]
        height = max(tall, default=0) + ROW_GAP + BAND_HEAD
        for left, width, stack, own in zip(lefts, widths, stacks, tall):
            y = top + BAND_HEAD + (height - BAND_HEAD - own) / 2
            for name in stack:
                y += ROW_GAP / 2
                made.at[name] = (left + width / 2, y + placed[name].height / 2)
                y += placed[name].height + ROW_GAP / 2
        made.bands[band] = (top, height)
        top += height + MARGIN
    made.height = round(top)
    spans = {name: (left, left + width) for left, width, column in zip(lefts, widths, columns) for name in column}
    for tail, head in edges:
        chain = chains.get((tail, head), [tail, head])
        points = [(made.at[tail][0] + placed[tail].width / 2, made.at[tail][1])]
        for name in chain[1:-1]:
            points += [(x, made.at[name][1]) for x in spans[name]]
        made.paths[tail, head] = [*points, (made.at[head][0] - placed[head].width / 2, made.at[head][1])]
    return made
