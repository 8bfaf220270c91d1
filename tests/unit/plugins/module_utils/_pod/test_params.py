# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which parameters are an app's, and what a master says to them."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator
from typing import Any
from xmlrpc.server import SimpleXMLRPCServer

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._pod import params

REVISION = "0a1b2c3d"
SETTINGS = {"node": "/arm", "params": {"~rate": 20, "~pid/gain": 1.5, "/limits": {"speed": 2}}}


def test_private_names_stand_under_the_node() -> None:
    assert params.assignments(SETTINGS) == {"/arm/rate": 20, "/arm/pid/gain": 1.5, "/limits": {"speed": 2}}
    assert params.assignments({"node": "/arm"}) == {}


@pytest.mark.parametrize(
    ("node", "given", "revision", "gone"),
    [
        ("/arm", SETTINGS["params"], REVISION, ["/arm/rate", "/arm/pid/gain"]),  # the next one has this name, too
        (f"/arm_{REVISION}", SETTINGS["params"], REVISION, [f"/arm_{REVISION}"]),  # nobody will have it any more
        (f"/arm_{REVISION}", {}, REVISION, [f"/arm_{REVISION}"]),
        ("/arm", {}, REVISION, []),
        ("/arm_", {}, "", []),
    ],
)
def test_what_goes_with_the_node(node: str, given: dict[str, Any], revision: str, gone: list[str]) -> None:
    assert params.leavings({"node": node, "params": given}, revision) == gone


class Master:
    """A parameter server that takes no list."""

    def __init__(self) -> None:
        self.there: dict[str, Any] = {}
        self.server = SimpleXMLRPCServer(("127.0.0.1", 0), logRequests=False)
        self.server.register_multicall_functions()
        self.server.register_function(self.set, "setParam")
        self.server.register_function(self.delete, "deleteParam")
        threading.Thread(target=self.server.serve_forever, kwargs={"poll_interval": 0.02}, daemon=True).start()
        self.environ = {"ROS_MASTER_URI": f"http://127.0.0.1:{self.server.server_address[1]}"}

    def set(self, _caller: str, name: str, value: Any) -> list[Any]:
        if isinstance(value, list):
            return [-1, "no lists here", 0]
        self.there[name] = value
        return [1, "", 0]

    def delete(self, _caller: str, name: str) -> list[Any]:
        return [1, "", 0] if self.there.pop(name, None) else [-1, f"parameter [{name}] is not set", 0]


@pytest.fixture
def master() -> Iterator[Master]:
    found = Master()
    yield found
    found.server.shutdown()
    found.server.server_close()


def test_all_are_set_or_it_is_said_which_are_not(master: Master) -> None:
    def settings(**more: Any) -> dict[str, str]:
        given = {**SETTINGS, "expect_node": True, "params": {**SETTINGS["params"], **more}}
        return {**master.environ, "ROSOPS_SETTINGS": json.dumps(given), "ROSOPS_NODE_NAME": "arm_1"}

    assert params.set_all(settings()) == ""
    assert master.there == {"/arm_1/rate": 20, "/arm_1/pid/gain": 1.5, "/limits": {"speed": 2}}
    assert params.set_all(settings(**{"~names": ["a"]})) == "/arm_1/names: no lists here"
    assert "does not answer" in params.set_all({**settings(), "ROS_MASTER_URI": "http://127.0.0.1:9"})


def test_what_is_not_there_is_forgotten_already(master: Master, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_MASTER_URI", master.environ["ROS_MASTER_URI"])
    monkeypatch.delenv("ROSOPS_REVISION", raising=False)
    master.there = {"/arm/rate": 20, "/arm/own": 1, "/limits": {}}
    params.forget(SETTINGS, 5)
    assert master.there == {"/arm/own": 1, "/limits": {}}
