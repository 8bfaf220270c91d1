# SPDX-License-Identifier: GPL-3.0-or-later
"""What is documented of a module, with its fragments, is what it reads and what it returns."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from typing import Any

import pytest
import yaml
from ansible_collections.rosops.fleet.plugins.action import rollout_ready as rollout_ready_action
from ansible_collections.rosops.fleet.plugins.module_utils._ros.client import ROS_ARGS
from ansible_collections.rosops.fleet.plugins.module_utils._ros.conditions import GATE_ARGS, VALUE_ARGS, WAIT_ARGS
from ansible_collections.rosops.fleet.plugins.modules import rollout_ready, ros_graph_info, ros_ready
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.access import ACCESS_ARGS

SPECS: dict[Any, Mapping[str, Any]] = {
    rollout_ready: {**ACCESS_ARGS, **rollout_ready_action.ActionModule.ARGUMENTS},
    ros_graph_info: {**ROS_ARGS, **ros_graph_info.INFO_ARGS},
    ros_ready: {**ROS_ARGS, **WAIT_ARGS, **GATE_ARGS, **VALUE_ARGS},
}
CALLER = ("elements", "aliases", "choices", "default", "required")  # has to know these to write an option, and its type
FRAGMENTS = "ansible_collections.rosops.fleet.plugins.doc_fragments"
of_each_module = pytest.mark.parametrize("module", SPECS, ids=lambda module: module.__name__.rpartition(".")[2])


def documented(module: Any) -> dict[str, Any]:
    """The options, with those of the fragments, as Ansible merges them."""
    text = yaml.safe_load(module.DOCUMENTATION)
    found: dict[str, Any] = {}
    extends = text.get("extends_documentation_fragment", [])
    for name in [extends] if isinstance(extends, str) else extends:
        _namespace, _collection, file, *part = name.split(".")
        fragment = importlib.import_module(f"{FRAGMENTS}.{file}").ModuleDocFragment
        said = getattr(fragment, part[0].upper() if part else "DOCUMENTATION")
        found |= yaml.safe_load(said)["options"]
    return {**found, **text["options"]}


def written(options: Mapping[str, Any], nested: str) -> dict[str, Any]:
    return {
        name: (
            one.get("type", "str"),
            {key: one[key] for key in CALLER if one.get(key)},
            written(one.get(nested, {}), nested),
        )
        for name, one in options.items()
    }


@of_each_module
def test_the_options_are_those_that_are_read(module: Any) -> None:
    assert written(documented(module), "suboptions") == written(SPECS[module], "options")


@of_each_module
def test_the_examples_use_options_that_there_are(module: Any) -> None:
    name = f"rosops.fleet.{module.__name__.rpartition('.')[2]}"
    own = [task[name] for task in yaml.safe_load(module.EXAMPLES) if name in task]
    assert own and all(set(options) <= set(SPECS[module]) for options in own)
