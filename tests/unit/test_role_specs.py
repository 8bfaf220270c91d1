# SPDX-License-Identifier: GPL-3.0-or-later
"""Roles say their defaults twice, in the argument specs and for Ansible: the same ones, of the right type."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.role_specs import role_options
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.secrets import OPAQUE, is_secret

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


@pytest.mark.parametrize("role", ["node", "preflight"])
def test_every_role_means_the_same_node(role: str) -> None:
    assert '"{{ k3s_node_name | default(inventory_hostname) }}"' in (ROLES / role / "tasks" / "main.yml").read_text()


def test_no_more_modules_than_users_can_know() -> None:
    """What is public is kept for all of a major version: another one takes the place of one of these."""
    assert len(list(ROLES.parent.glob("plugins/modules/*.py"))) <= 12


def test_no_more_variables_than_users_can_know() -> None:
    """As of modules: another one takes the place of one of these."""
    assert sum(len(role_options(role)) for role in NAMES) <= 100


def test_there_are_roles() -> None:
    assert {"preflight", "k3s", "images", "node", "robot_namespace", "storage", "ros_master", "ros_app"} <= set(NAMES)


@pytest.mark.parametrize("role", NAMES)
def test_defaults_are_the_specs(role: str) -> None:
    """Every option that is not required has its default in both places, the same one; nothing else has a default."""
    defaults = load(ROLES / role / "defaults" / "main.yml")
    known = role_options(role)
    required = {name for name, option in known.items() if option.get("required")}
    assert set(defaults) == set(known) - required
    assert {name: known[name].get("default") for name in defaults} == defaults


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
