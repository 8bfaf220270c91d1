# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Names as the master shows them."""

from __future__ import annotations

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._ros.names import resolve


@pytest.mark.parametrize(
    ("name", "namespace", "expected"),
    [
        ("/chatter", "/", "/chatter"),
        ("chatter", "/", "/chatter"),
        ("chatter", "/robot1", "/robot1/chatter"),
        ("chatter", "/robot1/", "/robot1/chatter"),
        ("chatter", "robot1", "/robot1/chatter"),
        ("/chatter", "/robot1", "/chatter"),
        ("a/b", "/r/s", "/r/s/a/b"),
        ("~rate", "/robot1", "/robot1/sensor/rate"),
        ("~/rate", "/robot1", "/robot1/sensor/rate"),
    ],
)
def test_resolve(name: str, namespace: str, expected: str) -> None:
    assert resolve(name, namespace, "/robot1/sensor") == expected
