# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Roles say the same thing in three places: argument specs, defaults, and the table that fleet_config checks with."""

from __future__ import annotations

import pprint
from pathlib import Path
from typing import Any

import pytest
import yaml
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.secrets import OPAQUE, is_secret
from ansible_collections.rosops.fleet.plugins.plugin_utils._validate.role_variables import OPTIONS, STRICT_TEXT
from ansible_collections.rosops.fleet.plugins.plugin_utils._validate.schema import FLEET_VARIABLES
from jinja2.nativetypes import NativeEnvironment

ROLES = Path(__file__).resolve().parents[2] / "roles"
NAMES = sorted(path.name for path in ROLES.iterdir() if (path / "tasks").is_dir())
TEMPLATES = NativeEnvironment()
KEPT = ("type", "elements", "choices", "required", "options")
PYTHON_TYPES: dict[str, Any] = {
    "str": str,
    "path": str,
    "int": int,
    "float": (int, float),
    "bool": bool,
    "list": list,
    "dict": dict,
}
JSON_TYPES = {
    "str": "string",
    "int": "integer",
    "float": "number",
    "bool": "boolean",
    "list": "array",
    "dict": "object",
}


def load(path: Path) -> dict[str, Any]:
    """A role's YAML file; empty where there is none."""
    return (yaml.safe_load(path.read_text("utf-8")) or {}) if path.exists() else {}


def entry_points(role: str) -> dict[str, dict[str, Any]]:
    specs: dict[str, dict[str, Any]] = load(ROLES / role / "meta" / "argument_specs.yml")["argument_specs"]
    return specs


def options(role: str) -> dict[str, dict[str, Any]]:
    """All options of a role's entry points."""
    return {
        name: option for entry in entry_points(role).values() for name, option in (entry.get("options") or {}).items()
    }


def stripped(option: dict[str, Any]) -> dict[str, Any]:
    kept = {key: option[key] for key in KEPT if option.get(key)}
    if "options" in kept:
        kept["options"] = {name: stripped(inner) for name, inner in kept["options"].items()}
    return kept


def rendered(value: Any) -> Any:
    """A default that is a template, where nothing that it refers to is set."""
    return TEMPLATES.from_string(value).render(observability={}) if isinstance(value, str) and "{{" in value else value


def all_options() -> dict[str, dict[str, Any]]:
    return {name: option for role in NAMES for name, option in options(role).items()}


def test_there_are_roles() -> None:
    assert {"preflight", "k3s", "images", "node", "robot_namespace", "storage", "ros_master", "ros_app"} <= set(NAMES)


@pytest.mark.parametrize("role", NAMES)
def test_defaults_are_the_specs(role: str) -> None:
    """Every option that is not required has its default in both places, the same one; nothing else has a default.

    One that comes from another variable stands in the specs as what it is where that one is not set: documentation has
    to have a value of the right type.
    """
    defaults = load(ROLES / role / "defaults" / "main.yml")
    known = options(role)
    required = {name for name, option in known.items() if option.get("required")}
    assert set(defaults) == set(known) - required
    specified = {name: known[name].get("default") for name in defaults}
    assert {name: rendered(value) for name, value in specified.items()} == {
        name: rendered(value) for name, value in defaults.items()
    }


@pytest.mark.parametrize("role", NAMES)
def test_defaults_have_the_type_of_the_spec(role: str) -> None:
    for name, value in load(ROLES / role / "defaults" / "main.yml").items():
        kind = options(role)[name]["type"]
        if kind != "raw" and not (isinstance(value, str) and "{{" in value):
            assert isinstance(value, PYTHON_TYPES[kind]), name
            assert kind == "bool" or not isinstance(value, bool), name


@pytest.mark.parametrize("role", NAMES)
def test_secrets_are_marked(role: str) -> None:
    for name, option in options(role).items():
        if is_secret(name) or name in OPAQUE[1:]:
            assert option.get("no_log") is True, name


def test_fleet_config_knows_every_role_variable() -> None:
    table = {name: stripped(option) for name, option in all_options().items() if name not in FLEET_VARIABLES}
    for option in table.values():
        option.pop("required", None)
    wanted = pprint.pformat(table, width=118, sort_dicts=False)
    assert table == OPTIONS, f"OPTIONS of plugins/module_utils/_role_variables.py should be:\n{wanted}"
    assert set(STRICT_TEXT) | set(OPAQUE) <= set(table)


def differences(option: dict[str, Any], schema: Any, path: str) -> list[str]:
    """Where an argument spec and the JSON Schema of the same thing disagree about keys, types or choices."""
    if "anyOf" in schema:  # several types: the spec has to be as open
        types = {branch.get("type") for branch in schema["anyOf"]}
        return (
            []
            if option["type"] in ("raw", "str") and "string" in types
            else [f"{path}: {option['type']} against {types}"]
        )
    if "enum" in schema:
        return [] if set(option.get("choices", [])) == set(schema["enum"]) else [f"{path}: choices {schema['enum']}"]
    if JSON_TYPES[option["type"]] != schema["type"]:
        return [f"{path}: {option['type']} against {schema['type']}"]
    if option["type"] == "list":
        inner = {**option, "type": option["elements"]}
        return differences(inner, schema["items"], f"{path}[]") if option["elements"] != "raw" else []
    if "properties" not in schema or "options" not in option:
        return [] if "options" not in option else [f"{path}: sub-options that the schema does not know"]
    found = [f"{path}: keys {set(option['options']) ^ set(schema['properties'])}"]
    if set(option["options"]) == set(schema["properties"]):
        required = {name for name, inner in option["options"].items() if inner.get("required")}
        found = (
            [] if required == set(schema["required"]) else [f"{path}: required {required ^ set(schema['required'])}"]
        )
    for name in set(option["options"]) & set(schema["properties"]):
        found += differences(option["options"][name], schema["properties"][name], f"{path}.{name}")
    return found


@pytest.mark.parametrize("name", FLEET_VARIABLES)
def test_fleet_variables_have_the_same_shape_in_roles_and_schema(name: str) -> None:
    option = all_options().get(name)
    if option is not None:
        assert differences(option, FLEET_VARIABLES[name], name) == []


def test_the_comparison_sees_differences() -> None:
    schema = FLEET_VARIABLES["node_taints"]
    good = all_options()["node_taints"]
    assert differences({**good, "type": "dict"}, schema, "x")
    assert differences({**good, "options": {"key": good["options"]["key"]}}, schema, "x")
    changed = {**good["options"], "effect": {"type": "str", "choices": ["NoSchedule"], "required": True}}
    assert differences({**good, "options": changed}, schema, "x")
