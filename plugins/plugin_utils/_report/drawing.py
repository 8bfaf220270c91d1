# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""A robot's ROS graph as boxes and lines with their places, and as text; the page's template draws them. Pure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from ansible_collections.rosops.fleet.plugins.plugin_utils._report.layout import Point, V, Vertex, layout
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.plots import rate_words

Row = Mapping[str, Any]
NODE_SIZE, TOPIC_SIZE = (176, 28), (168, 38)
LETTERS = 23  # of a name, that a box has room for
UNKNOWN = "elsewhere"


@dataclass(frozen=True)
class Box:
    """`look`: node, topic, with `down` or `broken`. `words` says all of it; `lines` are what the box has room for."""

    look: str
    words: str
    lines: tuple[str, ...]
    left: float
    top: float
    width: int
    height: int


@dataclass(frozen=True)
class Line:
    path: str
    broken: bool
    words: str


@dataclass(frozen=True)
class Drawing:
    """`bands`: label, top and height. `said` is the same graph as lines of text, `broken` how many pairs are."""

    robot: str
    width: int
    height: int
    bands: Sequence[tuple[str, float, float]]
    boxes: Sequence[Box]
    lines: Sequence[Line]
    said: Sequence[str]
    unheard: int
    broken: int


def drawing(graph: Row) -> Drawing:
    """Of a row of the section `graphs`."""
    nodes: dict[str, Row] = {node["name"]: node for node in graph["nodes"]}
    links: dict[str, Row] = {link["name"]: link for link in graph["links"]}
    for link in links.values():  # by somebody whose registration went while the graph was read
        for name in (*link["publishers"], *link["subscribers"]):
            nodes.setdefault(name, {"name": name, "at": "", "up": False})
    bands = _bands(str(graph["robot"]), nodes)
    vertices: dict[V, Vertex] = {
        ("node", name): Vertex(node["at"] or UNKNOWN, *NODE_SIZE) for name, node in nodes.items()
    }
    vertices |= {("topic", name): Vertex(_band(link, nodes), *TOPIC_SIZE, layer=1) for name, link in links.items()}
    ends = {edge: about for name, link in links.items() for edge, about in _edges(name, link).items()}
    made = layout(vertices, list(ends), bands)
    lines = [Line(_path(made.paths[edge]), broken, words) for edge, (broken, words) in ends.items()]
    boxes = [_box(key, vertex, made.at[key], nodes, links) for key, vertex in vertices.items()]
    return Drawing(
        str(graph["robot"]), made.width, made.height,
        [(band, *made.bands[band]) for band in bands],
        boxes, sorted(lines, key=lambda line: line.broken),
        [_said(link) for link in links.values()],
        int(graph["unheard"]), sum(len(link["broken"]) for link in links.values()),
    )  # fmt: skip


def _bands(robot: str, nodes: Mapping[str, Row]) -> list[str]:
    """The robot first, then who else has a part in it."""
    found = {str(node["at"] or UNKNOWN) for node in nodes.values()}
    return sorted(found, key=lambda band: (band != robot, band == UNKNOWN, band))


def _band(link: Row, nodes: Mapping[str, Row]) -> str:
    return str(nodes[[*link["publishers"], *link["subscribers"]][0]]["at"] or UNKNOWN)


def _edges(name: str, link: Row) -> dict[tuple[V, V], tuple[bool, str]]:
    """Each with whether it is broken, and words: a publisher's when it reaches nobody, a subscriber's when it misses
    somebody."""
    broken = [tuple(pair) for pair in link["broken"]]
    found: dict[tuple[V, V], tuple[bool, str]] = {}
    for publisher in link["publishers"]:
        missed = [one for one in link["subscribers"] if (publisher, one) in broken]
        none = bool(missed) and len(missed) == len(link["subscribers"])
        words = f"{publisher} is connected to no subscriber of {name}" if none else f"{publisher} sends {name}"
        found[("node", publisher), ("topic", name)] = none, words
    for subscriber in link["subscribers"]:
        missed = [one for one in link["publishers"] if (one, subscriber) in broken]
        words = f"{subscriber} hears {name}"
        if missed:
            words = f"{subscriber} has subscribed to {name} and is not connected to {', '.join(missed)}"
        found[("topic", name), ("node", subscriber)] = bool(missed), words
    return found


def _box(key: V, vertex: Vertex, middle: Point, nodes: Mapping[str, Row], links: Mapping[str, Row]) -> Box:
    kind, name = key
    lines: tuple[str, ...] = (short(name),)
    if kind == "node":
        up = nodes[name]["up"]
        look = "node" if up else "node down"
        words = f"ROS node {name} on {vertex.band}, {'up' if up else 'down'}"
    else:
        link = links[name]
        look, lines = "topic broken" if link["broken"] else "topic", (*lines, _carries(link))
        words = f"{'Action' if link['action'] else 'Topic'} {name}, {_carries(link)}"
    left, top = middle[0] - vertex.width / 2, middle[1] - vertex.height / 2
    return Box(look, words, lines, round(left, 1), round(top, 1), vertex.width, vertex.height)


def _carries(link: Row) -> str:
    if link["action"]:
        return "action"
    if not link["publishers"]:
        return "nobody publishes"
    return "rate not known" if link["rate"] is None else rate_words(float(link["rate"]))


def _said(link: Row) -> str:
    senders = ", ".join(link["publishers"]) or "nobody"
    text = f"{senders} → {link['name']} ({_carries(link)}) → {', '.join(link['subscribers'])}"
    pairs = [f"{publisher} and {subscriber}" for publisher, subscriber in link["broken"]]
    return text + (f"; not connected: {', '.join(pairs)}" if pairs else "")


def short(name: str) -> str:
    """The end of a name says more than its beginning.

    >>> short("/camera/front/depth/image_raw/compressed")
    '…h/image_raw/compressed'
    """
    return name if len(name) <= LETTERS else "…" + name[1 - LETTERS :]


def _path(points: Sequence[Point]) -> str:
    """Straight through a layer, curved between two."""
    parts = [f"M{points[0][0]:.1f} {points[0][1]:.1f}"]
    for (x, y), (to_x, to_y) in pairwise(points):
        if y == to_y and to_x > x:
            parts.append(f"L{to_x:.1f} {to_y:.1f}")
        else:
            bend = min(max(abs(to_x - x) / 2, 24), 90)  # one that leads back makes no great bow
            parts.append(f"C{x + bend:.1f} {y:.1f} {to_x - bend:.1f} {to_y:.1f} {to_x:.1f} {to_y:.1f}")
    return "".join(parts)
