# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which claims go where, and what is asked for and is not there."""

from __future__ import annotations

from typing import Any

from ansible_collections.rosops.fleet.plugins.plugin_utils._collect.sources import missing, sources


def claim(volume: str, namespace: str = "robot-robot1", number: int = 1) -> dict[str, Any]:
    directory = f"pvc-u{number}_{namespace}_{volume}-pvc"
    return {"directory": directory, "namespace": namespace, "claim": f"{volume}-pvc", "files": {}, "passed": []}


def test_each_claim_has_its_directory() -> None:
    found = sources({"edge1": [claim("logs", "fleet")], "robot1": [claim("logs"), claim("maps")]})
    assert [(one.host, one.target) for one in found] == [
        ("edge1", "fleet/logs"),
        ("robot1", "robot1/logs"),
        ("robot1", "robot1/maps"),
    ]


def test_a_claim_that_is_there_twice_is_told_apart_by_its_volume() -> None:
    found = sources({"robot1": [claim("logs", number=2)], "edge1": [claim("logs", number=1)]})
    assert [one.target for one in found] == ["robot1/logs.pvc-u1", "robot1/logs.pvc-u2"]


def test_what_no_host_has() -> None:
    assert list(missing({"robot1": [claim("logs")]}, ["logs", "bags"])) == ["bags"]
