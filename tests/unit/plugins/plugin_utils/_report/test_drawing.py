# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""A ROS graph as boxes and lines: a robot of 30 nodes stays readable, and what is broken is seen and said."""

from __future__ import annotations

from itertools import combinations

from ansible_collections.rosops.fleet.plugins.plugin_utils._report.drawing import drawing, short
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.page import status_page
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._report import a_robot
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._report.html_check import Page

ROW = a_robot.row(broken=(("/merger", "/amcl"), ("/ekf", "/docking")), down=("/joystick",))


def test_a_robot_of_thirty_nodes_has_room_for_all() -> None:
    made = drawing(ROW)
    nodes = [box for box in made.boxes if box.look.startswith("node")]
    assert len(nodes) == 30
    for one, other in combinations(made.boxes, 2):
        assert (
            one.left + one.width <= other.left
            or other.left + other.width <= one.left
            or one.top + one.height <= other.top
            or other.top + other.height <= one.top
        ), (one, other)
    assert all(box.left >= 0 and box.left + box.width <= made.width for box in made.boxes)
    assert made.height < 1000


def test_nodes_stand_where_they_run() -> None:
    made = drawing(ROW)
    assert [label for label, _top, _height in made.bands] == ["robot1", "edge1"]
    _label, top, height = made.bands[1]
    inside = {box.lines[0] for box in made.boxes if box.look.startswith("node") and top < box.top < top + height}
    assert inside == {"/detector", "/dashboard", "/fleet_link"}


def test_what_is_broken_is_drawn_last_and_said() -> None:
    made = drawing(ROW)
    assert made.broken == 2
    broken = [line for line in made.lines if line.broken]
    assert made.lines[-len(broken) :] == broken
    assert "/amcl has subscribed to /scan and is not connected to /merger" in [line.words for line in broken]
    assert [box.words for box in made.boxes if box.look == "node down"] == ["ROS node /joystick on robot1, down"]
    assert [text for text in made.said if "not connected" in text] == [
        "/ekf → /odometry/filtered (50.0 Hz) → /amcl, /move_base, /slam, /docking; not connected: /ekf and /docking",
        "/merger → /scan (15.0 Hz) → /amcl, /move_base, /slam; not connected: /merger and /amcl",
    ]


def test_a_publisher_that_reaches_nobody_is_seen_on_its_side_too() -> None:
    made = drawing(a_robot.row(broken=(("/imu", "/ekf"),)))
    assert [line.words for line in made.lines if line.broken and line.words.startswith("/imu")] == [
        "/imu is connected to no subscriber of /imu/data"
    ]


def test_a_registration_without_a_node_and_a_topic_without_a_publisher_are_drawn() -> None:
    link = {"name": "/t", "rate": None, "action": False, "publishers": [], "subscribers": ["/gone"], "broken": []}
    made = drawing({"robot": "robot1", "nodes": [], "links": [link], "unheard": 0})
    assert [(box.lines, box.look) for box in made.boxes] == [
        (("/gone",), "node down"),
        (("/t", "nobody publishes"), "topic"),
    ]


def test_an_empty_graph() -> None:
    made = drawing({"robot": "robot1", "nodes": [], "links": [], "unheard": 0})
    assert (made.boxes, made.lines, made.bands) == ([], [], [])


def test_long_names_end_as_they_end() -> None:
    assert short("/a") == "/a"
    assert short("/camera/front/depth/image_raw") == "…/front/depth/image_raw"


def test_on_the_page_it_is_text_too_and_fetches_nothing() -> None:
    found = Page(status_page({"graphs": [ROW]}, "2026-11-21T09:07:52Z"))
    assert found.problems == []
    named = {about["aria-label"] for _tag, about in found.attributes if "aria-label" in about}
    assert {"ROS node /slam on robot1, up", "Topic /scan, 15.0 Hz", "Action /move_base, action"} <= named
    assert "ROS graph of robot1: messages go from left to right" in named
    assert found.tags.count("title") > 100
    assert any("not connected: /merger and /amcl" in text for text in found.texts)


def test_many_graphs_are_folded_but_for_those_with_a_fault() -> None:
    good = a_robot.row()
    rows = [{**good, "robot": f"robot{number}"} for number in range(6)] + [{**ROW, "robot": "robot9"}]
    text = status_page({"graphs": rows}, "2026-11-21T09:07:52Z")
    assert text.count('<details class="graph">') == 6 and text.count('<details class="graph" open>') == 1
