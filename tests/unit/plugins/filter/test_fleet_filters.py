# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Filters: that each is there, documented, and fails as Ansible expects; fleet_hosts picks what fleet_config needs."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

import pytest
import yaml
from ansible.errors import AnsibleFilterError

PLUGINS = Path(__file__).resolve().parents[4] / "plugins" / "filter"
NAMES = (
    "fleet_images", "namespace_objects", "storage_objects",
    "ros_master_objects", "ros_app_objects", "ros_hook_objects", "ros_conditions",
)  # fmt: skip
CTX = {"robot": "robot1", "apps": [{"name": "a", "image": "a:1", "args": ["x"]}], "volumes": [{"name": "v"}]}


def module_of(name: str) -> Any:
    return importlib.import_module(f"ansible_collections.rosops.fleet.plugins.filter.{name}")


def filter_of(name: str) -> Any:
    return module_of(name).FilterModule().filters()[name]


@pytest.mark.parametrize("name", NAMES)
def test_filters_are_documented(name: str) -> None:
    module = module_of(name)
    assert yaml.safe_load(module.DOCUMENTATION)["name"] == name
    assert yaml.safe_load(module.EXAMPLES)
    assert "_value" in yaml.safe_load(module.RETURN)
    assert list(module.FilterModule().filters()) == [name]


@pytest.mark.parametrize(
    ("name", "kinds"),
    [
        ("namespace_objects", ["Namespace"]),
        ("storage_objects", ["PersistentVolumeClaim"]),
        ("ros_master_objects", ["Deployment", "Service", "Deployment", "Service"]),
        ("ros_app_objects", ["ConfigMap", "Deployment"]),
        ("ros_hook_objects", ["ConfigMap"]),
    ],
)
def test_object_filters(name: str, kinds: list[str]) -> None:
    assert [item["kind"] for item in filter_of(name)(CTX)] == kinds


def test_other_filters() -> None:
    assert filter_of("ros_conditions")(CTX)["nodes"] == ["/a"]
    assert filter_of("fleet_images")(CTX, "remote") == ["a:1"]


@pytest.mark.parametrize(
    "bad", [{}, {"robot": "r", "apps": [5]}, {"robot": "r", "volumes": [{}]}, {"robot": "r", "apps": 1}]
)
def test_a_malformed_context_is_an_error_of_ansibles(bad: Any) -> None:
    with pytest.raises(AnsibleFilterError, match=r"rosops.fleet.ros_app_objects: the input is not shaped"):
        filter_of("ros_app_objects")(bad)
