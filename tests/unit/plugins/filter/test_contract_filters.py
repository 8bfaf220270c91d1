# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
from __future__ import annotations

import importlib
import inspect
from typing import Any

import pytest
import yaml
from ansible.errors import AnsibleFilterError

GRAPH: dict[str, Any] = {
    "nodes": {"/a_old": {"reachable": True}},
    "topics": {
        "/t": {
            "type": "a/B",
            "md5sum": None,
            "publishers": ["/a_old"],
            "subscribers": [],
            "connections": [],
            "rates": {"/a_old": 10.0},
        }
    },
    "services": {},
    "actions": {},
}


def module_of(name: str) -> Any:
    return importlib.import_module(f"ansible_collections.rosops.fleet.plugins.filter.{name}")


def filter_of(name: str) -> Any:
    return module_of(name).FilterModule().filters()[name]


@pytest.mark.parametrize("name", ["ros_contract", "contract_conditions"])
def test_the_documentation_has_every_option_with_its_default(name: str) -> None:
    module = module_of(name)
    documentation = yaml.safe_load(module.DOCUMENTATION)
    _first, *parameters = inspect.signature(filter_of(name)).parameters.values()
    options = {key: value for key, value in documentation["options"].items() if key != "_input"}
    assert list(options) == [parameter.name for parameter in parameters]
    for parameter in parameters:
        if parameter.default is parameter.empty:
            assert options[parameter.name]["required"]
        else:
            assert (options[parameter.name].get("default") or None) == (parameter.default or None)
    assert yaml.safe_load(module.EXAMPLES)
    assert "_value" in yaml.safe_load(module.RETURN)


def test_from_a_graph_to_conditions() -> None:
    contract = filter_of("ros_contract")(GRAPH, ["/a_old"], {"/a_old": "/a_new"}, revision="1")
    assert set(contract) == set(yaml.safe_load(module_of("ros_contract").RETURN)["_value"]["sample"])
    found = filter_of("contract_conditions")(contract, absent=["/a_old"])
    assert (found["nodes"], found["absent"]) == (["/a_new"], ["/a_old"])
    assert found["topics"][0]["min_rate"] == 9.0


@pytest.mark.parametrize("name", ["ros_contract", "contract_conditions"])
def test_what_is_neither_graph_nor_contract_is_an_error_of_ansibles(name: str) -> None:
    with pytest.raises(AnsibleFilterError, match=f"rosops.fleet.{name}: the input is not shaped"):
        filter_of(name)({}, [])
