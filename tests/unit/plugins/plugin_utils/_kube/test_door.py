# SPDX-License-Identifier: GPL-3.0-or-later
"""A keeper's door as it is asked through the API server."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.connection import ApiError
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.door import SHUT, KeeperDoor

SERVICE = "/api/v1/namespaces/fleet/services/ros-keeper:11411/proxy"


class ApiServer:
    """Answers with these bytes, or fails."""

    def __init__(self, answer: bytes | Exception) -> None:
        self.answer, self.asked, self.at = answer, list[tuple[Any, ...]](), 100.0

    def request(self, *asked: Any) -> Any:
        self.asked.append(asked)
        if isinstance(self.answer, Exception):
            raise self.answer
        return SimpleNamespace(read=lambda most: self.answer[:most])

    @property
    def door(self) -> KeeperDoor:
        kube: Any = self
        return KeeperDoor(kube, "fleet", "robot-robot1", "host 1 (ab)", lambda: self.at)


def test_a_job_is_asked_for_in_the_name_of_the_run_and_has_its_time() -> None:
    api = ApiServer(b'{"verdict": "pass"}')
    assert api.door.job("ready", {"timeout": 8.0, "rate_seconds": 1.0}) == {"verdict": "pass"}
    api.door.there()
    query = {"namespace": "robot-robot1", "holder": "host 1 (ab)"}
    body = {"timeout": 8.0, "rate_seconds": 1.0}
    assert api.asked == [
        ("POST", f"{SERVICE}/v1/jobs/ready", query, body, "application/json", 29.0),
        ("GET", f"{SERVICE}/ready", {}, None, "", 20.0),
    ]


@pytest.mark.parametrize("error", [ApiError("no endpoints available", 503), OSError("it closed the connection")])
def test_a_door_that_does_not_answer_is_left_alone_for_a_while(error: Exception) -> None:
    api = ApiServer(error)
    door = api.door
    for _again in range(3):
        with pytest.raises(ApiError, match=str(error)):
            door.job("graph", {})
    assert len(api.asked) == 1
    api.at, api.answer = api.at + SHUT, b"{}"
    assert door.job("graph", {}) == {}


@pytest.mark.parametrize("answer", [b"<html>", b"7"])
def test_what_is_no_answer_of_a_keeper(answer: bytes) -> None:
    with pytest.raises(ApiError, match="no JSON for graph"):
        ApiServer(answer).door.job("graph", {})
