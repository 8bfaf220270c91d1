# SPDX-License-Identifier: GPL-3.0-or-later
"""Overrides laid over objects, and a robot's apps in layers."""

from __future__ import annotations

import copy
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.finding import Problem
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.merge import deep_merge, layered


@pytest.mark.parametrize(
    ("base", "overrides", "merged"),
    [
        ({"a": {"b": 1, "c": 2}}, {"a": {"b": 3}}, {"a": {"b": 3, "c": 2}}),  # the dissertation's algorithm 1
        ({"a": {"b": 1}}, {"a": 5}, {"a": 5}),
        ({"a": 1, "b": 2}, {"a": None, "x": None}, {"b": 2}),
        ({"l": [1, 2]}, {"l": [3]}, {"l": [3]}),
        (
            {"env": [{"name": "A", "value": "1"}, {"name": "B", "value": "2"}]},
            {"env": [{"name": "C", "value": "3"}, {"name": "A", "value": "9"}]},
            {"env": [{"name": "A", "value": "9"}, {"name": "B", "value": "2"}, {"name": "C", "value": "3"}]},
        ),
        (
            {"env": [{"name": "A", "value": "1"}]},
            {"env": [{"name": "A", "value": None, "valueFrom": {"x": 1}}]},
            {"env": [{"name": "A", "valueFrom": {"x": 1}}]},
        ),
        (
            {"env": [{"name": "A"}, {"name": "B"}]},
            {"env": [{"name": "A", "$patch": "delete"}]},
            {"env": [{"name": "B"}]},
        ),
        (
            {"volumeMounts": [{"name": "a", "mountPath": "/a"}]},
            {"volumeMounts": [{"name": "a", "mountPath": "/b"}, {"name": "a", "mountPath": "/a", "readOnly": True}]},
            {"volumeMounts": [{"name": "a", "mountPath": "/a", "readOnly": True}, {"name": "a", "mountPath": "/b"}]},
        ),
        (
            {"ports": [{"containerPort": 1, "name": "x"}]},
            {"ports": [{"containerPort": 1, "protocol": "UDP"}]},
            {"ports": [{"containerPort": 1, "name": "x", "protocol": "UDP"}]},
        ),
        ({"l": [{"name": "a"}]}, {"l": [{"x": 1}]}, {"l": [{"x": 1}]}),
        ({}, {"a": {"b": None, "c": [{"d": None, "e": 1}]}}, {"a": {"c": [{"e": 1}]}}),
    ],
)
def test_deep_merge(base: dict[str, Any], overrides: dict[str, Any], merged: dict[str, Any]) -> None:
    before = copy.deepcopy((base, overrides))
    assert deep_merge(base, overrides) == merged
    assert (base, overrides) == before


def test_what_is_merged_is_a_document_of_its_own() -> None:
    base, value = {"a": {"b": [1]}}, {"c": [2]}
    merged = deep_merge(base, value)
    merged["a"]["b"] += merged["c"]
    merged["c"] += [3]
    assert (base, value) == ({"a": {"b": [1]}}, {"c": [2]})


LIDAR: dict[str, Any] = {
    "name": "lidar", "image": "x:1", "args": ["a", "b"], "params": {"skip": 1, "pid": {"p": 1, "i": 2}},
    "files": [{"path": "/a", "content": "1"}, {"path": "/b", "content": "2"}],
    "readiness": {"topics": [{"name": "scan", "min_rate": 10}, {"name": "cloud"}]},
}  # fmt: skip
OTHER = {"name": "other", "image": "y:1"}


def apps(*layers: list[dict[str, Any]] | None) -> list[dict[str, Any]]:
    given = dict(zip(("ros_apps", "ros_apps_model", "ros_apps_robot"), layers))
    before, problems = copy.deepcopy(given), list[Problem]()
    found = layered(given, "hosts.r", problems)
    assert (given, problems) == (before, [])
    assert [*found] == ["ros_apps"]
    return list(found["ros_apps"])


def test_the_later_layer_counts_and_what_it_does_not_say_stays() -> None:
    model = {"name": "lidar", "image": "x:2", "params": {"skip": None, "pid": {"i": 3}}, "args": ["c"]}
    (found,) = apps([LIDAR], [model], [{"name": "lidar", "image": "x:3"}])
    assert found == {**LIDAR, "image": "x:3", "args": ["c"], "params": {"pid": {"p": 1, "i": 3}}}


def test_items_with_names_are_laid_over_each_other() -> None:
    topics = {"topics": [{"name": "scan", "min_rate": 5}]}
    files = [{"path": "/b", "content": "3"}, {"path": "/c", "content": "4"}]
    (found,) = apps([LIDAR], [{"name": "lidar", "readiness": topics, "files": files}])
    assert found["readiness"] == {"topics": [{"name": "scan", "min_rate": 5}, {"name": "cloud"}]}
    assert [(one["path"], one["content"]) for one in found["files"]] == [("/a", "1"), ("/b", "3"), ("/c", "4")]


def test_one_app_more_and_one_less() -> None:
    gone = {"name": "lidar", "$patch": "delete"}
    assert apps([LIDAR], [OTHER]) == [LIDAR, OTHER]
    assert apps([LIDAR, OTHER], [gone]) == [OTHER]
    assert apps([LIDAR, OTHER], [gone], [{**LIDAR, "image": "x:9"}]) == [OTHER, {**LIDAR, "image": "x:9"}]
    assert apps([], [], [OTHER]) == [OTHER]


@pytest.mark.parametrize("layer", ["ros_apps_model", "ros_apps_robot"])
def test_without_apps_of_the_fleet_a_layer_is_all_there_is(layer: str) -> None:
    assert layered({layer: [OTHER]}, "hosts.r", []) == {"ros_apps": [OTHER]}


@pytest.mark.parametrize("wrong", [{"name": "a"}, "a", 1, None, [1], [{"image": "x"}], [{"name": 1}]])
def test_what_has_another_shape_is_left_to_its_schema(wrong: Any) -> None:
    given = {"ros_apps": [LIDAR], "ros_apps_model": wrong, "ros_apps_robot": [OTHER]}
    assert layered(given, "hosts.r", []) == {"ros_apps": [LIDAR, OTHER], "ros_apps_model": wrong}
    given = {"ros_apps": wrong or [1], "ros_apps_robot": [OTHER]}
    assert layered(given, "hosts.r", []) == given
