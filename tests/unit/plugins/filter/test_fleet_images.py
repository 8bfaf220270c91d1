# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The filter: documented, and failing as Ansible expects."""

from __future__ import annotations

from typing import Any

import pytest
import yaml
from ansible.errors import AnsibleFilterError
from ansible_collections.rosops.fleet.plugins.filter import fleet_images
from ansible_collections.rosops.fleet.tests.unit.robots import robot

FILTER = fleet_images.FilterModule().filters()["fleet_images"]


def test_it_is_documented() -> None:
    assert yaml.safe_load(fleet_images.DOCUMENTATION)["name"] == "fleet_images"
    assert yaml.safe_load(fleet_images.EXAMPLES)
    assert "_value" in yaml.safe_load(fleet_images.RETURN)


def test_images_of_a_placement() -> None:
    assert FILTER(robot({"name": "a", "image": "a:1"}).as_dict(), "remote") == ["a:1"]


@pytest.mark.parametrize("bad", [{}, {"name": "r", "apps": [5]}, {"name": "r", "apps": 1}])
def test_a_malformed_robot_is_an_error_of_ansibles(bad: Any) -> None:
    with pytest.raises(AnsibleFilterError, match=r"rosops.fleet.fleet_images: the input is not shaped"):
        FILTER(bad)
