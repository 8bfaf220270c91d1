# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Roles say their defaults twice, in the argument specs and for Ansible: the same ones, of the right type."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.role_specs import role_options
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.secrets import OPAQUE, is_secret
from jinja2.nativetypes import NativeEnvironment

ROLES = Path(__file__).resolve().parents[2] / "roles"
NAMES = sorted(path.name for path in ROLES.iterdir() if (path / "tasks").is_dir())
PYTHON_TYPES: dict[str, Any] = {
    "str": str,
    "path": str,
    "int": int,
    "float": (int, float),
    "bool": bool,
    "list": list,
    "dict": dict,
}


def load(path: Path) -> dict[str, Any]:
    """A role's YAML file; empty where there is none."""
    return (yaml.safe_load(path.read_text("utf-8")) or {}) if path.exists() else {}


def rendered(value: Any) -> Any:
    """A default that is a template, where nothing that it refers to is set."""
    return (
        NativeEnvironment().from_string(value).render(observability={})
        if isinstance(value, str) and "{{" in value
        else value
    )


@pytest.mark.parametrize(("role", "variable"), [("node", "node_name"), ("preflight", "preflight_node_name")])
def test_every_role_means_the_same_node(role: str, variable: str) -> None:
    default = NativeEnvironment().from_string(load(ROLES / role / "defaults" / "main.yml")[variable])
    assert default.render(inventory_hostname="robot1", k3s_node_name="node-1") == "node-1"
    assert default.render(inventory_hostname="robot1") == "robot1"


def test_no_more_modules_than_users_can_know() -> None:
    """What is public is kept for all of a major version: another one takes the place of one of these."""
    assert len(list(ROLES.parent.glob("plugins/modules/*.py"))) <= 12


def test_there_are_roles() -> None:
    assert {"preflight", "k3s", "images", "node", "robot_namespace", "storage", "ros_master", "ros_app"} <= set(NAMES)


@pytest.mark.parametrize("role", NAMES)
def test_defaults_are_the_specs(role: str) -> None:
    """Every option that is not required has its default in both places, the same one; nothing else has a default.

    One that comes from another variable stands in the specs as what it is where that one is not set: documentation has
    to have a value of the right type.
    """
    defaults = load(ROLES / role / "defaults" / "main.yml")
    known = role_options(role)
    required = {name for name, option in known.items() if option.get("required")}
    assert set(defaults) == set(known) - required
    specified = {name: known[name].get("default") for name in defaults}
    assert {name: value for name, value in defaults.items() if specified[name] not in (value, rendered(value))} == {}


@pytest.mark.parametrize("role", NAMES)
def test_defaults_have_the_type_of_the_spec(role: str) -> None:
    for name, value in load(ROLES / role / "defaults" / "main.yml").items():
        kind = role_options(role)[name]["type"]
        if kind != "raw" and not (isinstance(value, str) and "{{" in value):
            assert isinstance(value, PYTHON_TYPES[kind]), name
            assert kind == "bool" or not isinstance(value, bool), name


@pytest.mark.parametrize("role", NAMES)
def test_secrets_are_marked(role: str) -> None:
    for name, option in role_options(role).items():
        if is_secret(name) or name in OPAQUE[1:]:
            assert option.get("no_log") is True, name
