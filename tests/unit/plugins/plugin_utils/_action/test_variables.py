# SPDX-License-Identifier: GPL-3.0-or-later
"""A role's variables, templated by Ansible itself and of their specs' types."""

from __future__ import annotations

from typing import Any

import pytest
from ansible.parsing.dataloader import DataLoader
from ansible.template import Templar, trust_as_template
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.plugin_utils._action.variables import OF_EVERY_CHANGE, role_variables
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.role_specs import role_options

REQUIRED = {"k3s_role": "server", "k3s_cluster": "edge", "k3s_server_hosts": ["edge1"]}


def read(**given: Any) -> dict[str, Any]:
    known = {**REQUIRED, **given}
    return role_variables("k3s", (), Templar(loader=DataLoader(), variables=known), known)


def test_only_the_roles_own_are_read() -> None:
    assert set(read(another="x")) == set(role_options("k3s"))


def test_what_counts_for_every_change_is_the_updates() -> None:
    given = {"update_busy_timeout": "20", "update_to": "previous"}
    found = role_variables("update", OF_EVERY_CHANGE, Templar(loader=DataLoader(), variables=given), given)
    assert found == {"update_on_busy": "wait", "update_busy_timeout": 20, "update_failure_budget": "0"}


def test_values_are_templated_plain_and_of_the_specs_type() -> None:
    config = {"a": trust_as_template("{{ k3s_start_timeout }}"), "b": [trust_as_template("{{ k3s_role }}")]}
    found = read(k3s_start_timeout="20", k3s_config=config, k3s_remove_volumes="yes")
    assert found["k3s_config"] == {"a": "20", "b": ["server"]}
    assert {type(found["k3s_config"]["a"]), type(found["k3s_config"]["b"][0])} == {str}
    assert (found["k3s_start_timeout"], found["k3s_remove_volumes"]) == (20, True)


def test_all_wrong_ones_are_named() -> None:
    with pytest.raises(SpecError, match=r"(?s)variables of the role k3s: .*k3s_start_timeout.*k3s_role"):
        read(k3s_role="king", k3s_start_timeout="soon")
