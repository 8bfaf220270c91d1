# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What stands in an inventory and does not do what it says."""

from __future__ import annotations

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._validate.inventory import inventory_problems


@pytest.mark.parametrize(
    ("program", "said"),
    [
        ("/usr/bin/python3.7", "is /usr/bin/python3.7: the host has Python 3.7, and ansible-core"),
        ("/usr/bin/python3.11", ""),
        ("/usr/bin/python3", ""),
        ("auto", ""),
    ],
)
def test_a_python_that_is_named_and_too_old(program: str, said: str) -> None:
    found = inventory_problems({"robot1": {"ansible_python_interpreter": program}}, ["robot1"], {})
    assert [one.path for one in found] == ["hosts.robot1.ansible_python_interpreter"] * bool(said)
    assert all(one.problem.startswith(said) for one in found)
