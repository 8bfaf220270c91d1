# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""A host's address is the inventory's."""

from __future__ import annotations

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.addresses import address


@pytest.mark.parametrize(
    ("known", "expected"),
    [
        ({}, "edge1"),
        ({"ansible_host": "10.0.0.1"}, "10.0.0.1"),
        ({"ansible_host": "10.0.0.1", "k3s_node_ip": "192.168.1.1,fd00::1"}, "192.168.1.1"),
        ({"ansible_host": "fd00::1"}, "[fd00::1]"),
    ],
)
def test_address(known: dict[str, str], expected: str) -> None:
    assert address("edge1", {"edge1": known}) == expected
