# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
from __future__ import annotations

import pytest
from ansible.errors import AnsibleFilterError
from ansible_collections.rosops.fleet.plugins.filter import fleet_status, nodes_off, status_table

ROWS = fleet_status.FilterModule().filters()["fleet_status"]
OFF = nodes_off.FilterModule().filters()["nodes_off"]
PAGE = status_table.FilterModule().filters()["status_table"]


def test_from_nothing_to_a_page() -> None:
    assert PAGE(ROWS({"hosts": [{"name": "edge1"}]}), width=80).startswith("HOSTS\n  host")


def test_a_wrong_shape_is_an_error_of_the_filter() -> None:
    with pytest.raises(AnsibleFilterError, match=r"rosops.fleet.fleet_status"):
        ROWS({"nodes": ["edge1"]})


def test_a_node_is_off_unless_it_says_that_it_is_ready() -> None:
    def node(name: str, *conditions: tuple[str, str]) -> dict[str, object]:
        said = [{"type": kind, "status": status} for kind, status in conditions]
        return {"metadata": {"name": name}, "status": {"conditions": said}}

    nodes = [
        node("on", ("DiskPressure", "False"), ("Ready", "True")),
        node("away", ("Ready", "Unknown")),
        node("broken", ("DiskPressure", "True"), ("Ready", "False")),
        node("new"),
    ]
    assert OFF(nodes) == ["away", "broken", "new"]
    assert OFF([]) == []
