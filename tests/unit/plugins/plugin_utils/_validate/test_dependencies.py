# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The order that apps may ask for; what cannot be kept is in the table of bad inputs."""

from __future__ import annotations

from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._validate.dependencies import dependency_problems
from ansible_collections.rosops.fleet.plugins.plugin_utils._validate.draft import draft


def app(name: str, *after: str, **more: Any) -> dict[str, Any]:
    return {"name": name, "image": "example.org/a:1", "depends_on": list(after), **more}


@pytest.mark.parametrize(
    "apps",
    [
        [app("a", "b"), app("b", "c"), app("c")],
        [app("a", "b", "c"), app("b", "c"), app("c")],
        # within a group and to the outside, but never back
        [app("a", "b", update={"group": "g"}), app("b", "c", update={"group": "g"}), app("c")],
        [app("a"), app("c", "a"), app("d", "a")],
    ],
)
def test_orders_that_can_be_kept(apps: list[Any]) -> None:
    assert list(dependency_problems(draft("r1", {"ros_apps": apps}, []))) == []
