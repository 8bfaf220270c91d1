# SPDX-License-Identifier: GPL-3.0-or-later
"""The schema of the variables: what comes from the argument specs, and what is added to them."""

from __future__ import annotations

from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._ros.conditions import VALUE_ARGS
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.app import Condition
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.formats import FORMS as KNOWN
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.formats import Form
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.keys import Key, Kind, keys
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.role_specs import all_options
from ansible_collections.rosops.fleet.plugins.plugin_utils._validate.schema import (
    FORMS,
    OWN,
    needed,
    of_host,
    value_problems,
    variables,
)


def paths(option: Any, path: str) -> set[str]:
    """An option's path and those below it, as forms are named."""
    found = {path}
    if option["type"] == "list":
        found |= {f"{path}[]"}
    inside = f"{path}[]" if option["type"] == "list" else path
    for name, inner in (option.get("options") or {}).items():
        found |= paths(inner, f"{inside}.{name}")
    return found


def forms(found: Any) -> set[Form]:
    """The forms in a kind."""
    if isinstance(found, Form):
        return {found}
    if isinstance(found, Kind):
        return forms(found.inner) | forms(found.notes)
    inner = found.values() if isinstance(found, dict) else found if isinstance(found, tuple) else ()
    return set().union(*(forms(one.kind if isinstance(one, Key) else one) for one in inner))


def test_every_form_is_of_a_value_that_there_is() -> None:
    known = {path for name, option in all_options().items() for path in paths(option, name)}
    assert set(FORMS) <= known
    assert set(OWN).isdisjoint(all_options())


def test_every_format_is_used() -> None:
    used = {form.allowed for form in forms(of_host())}
    unused = {name for name, form in KNOWN.items() if form.allowed not in used}
    assert unused == {"robot-name"}  # of a group's hosts, which are no variables


def test_what_messages_must_say_is_written_as_the_module_takes_it() -> None:
    options = VALUE_ARGS["values"]["options"]
    assert set(keys(Condition)) == set(options)
    assert {name for name, key in keys(Condition).items() if key.required} == {
        name for name, option in options.items() if option.get("required")
    }


def wrong(name: str, value: Any) -> bool:
    return bool(value_problems({name: value}, of_host(), "h"))


@pytest.mark.parametrize(
    ("name", "good", "bad"),
    [
        ("k3s_start_timeout", [5, "5"], ["five", 5.5, True, None]),
        ("update_rate_tolerance", [0.1, 1, "0.1"], ["some", True]),
        ("k3s_node_name", ["n", 7], [True, []]),
        ("k3s_token", ["t"], [7, True]),
        ("k3s_remove_volumes", [True, "yes", 0, "True"], ["perhaps", 2, None, []]),
        ("observability_profile", ["hub"], ["cloud"]),
        ("images_refs", [[], ["a"]], ["a", [[]]]),
        ("k3s_config", [{}, {"anything": 1}], ["text"]),
        ("images_archives", [[{"path": "a"}]], [[{}], [{"path": "a", "other": 1}], [{"path": 5}]]),
        ("preflight_clock_offset", [{"maximum": 1, "recommended": 0.5}], [{"maximum": 1}, {"maximum": "1"}]),
        ("robot_mode", ["agent"], ["cloud", None]),
        ("fleet_kubeconfig_dir", ["/k"], ["", 5]),
        ("ros_master_placement", ["", "local"], ["edge"]),
        ("ros_apps", [[]], [[{"name": "a", "image": "i", "hooks": "yes"}], [{"name": "a"}]]),
        ("nobodys", [], [1]),
    ],
)
def test_types_of_a_variable(name: str, good: list[Any], bad: list[Any]) -> None:
    assert [value for value in good if wrong(name, value)] == []
    assert [value for value in bad if not wrong(name, value)] == []


def test_what_the_validation_needs_and_what_it_leaves_to_the_role() -> None:
    names = {"ros_apps", "robot_mode", "ros_master_mode", "node_taints", "observability_hub_url"}
    left = {"k3s_token", "k3s_kubeconfig_path", "k3s_node_name", "ros_app"}
    assert {name for name in names | left if needed(name)} == names < {*variables()}
