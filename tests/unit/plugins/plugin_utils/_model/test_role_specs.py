# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the roles' variables are read from."""

from __future__ import annotations

from pathlib import Path

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.plugin_utils._model import role_specs
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.role_specs import all_options, role_options


def test_all_entry_points_of_all_roles() -> None:
    assert set(role_options("ros_app")) == {"ros_apps", "ros_apps_model", "ros_apps_robot", "ros_app_rollout_timeout"}
    found = all_options()
    assert found["k3s_role"]["choices"] == ["server", "agent"]
    assert found["ros_app_rollout_timeout"]["type"] == "int"


@pytest.mark.parametrize("there", [True, False])
def test_a_collection_without_its_roles_says_so(there: bool, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(role_specs, "ROLES", tmp_path if there else tmp_path / "gone")
    with pytest.raises(SpecError, match="the collection is not whole"):
        role_options("no_role")
