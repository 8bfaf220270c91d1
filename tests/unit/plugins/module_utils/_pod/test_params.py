# SPDX-License-Identifier: GPL-3.0-or-later
"""Which parameters are an app's, and what a master says to them."""

from __future__ import annotations

import json
import os
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._pod import params
from ansible_collections.rosops.fleet.plugins.module_utils._pod.kept_params import leaves_of, tree_of, value_at
from ansible_collections.rosops.fleet.plugins.module_utils._pod.state import Settings, load_settings
from ansible_collections.rosops.fleet.tests.unit.plugins.fake_ros import Peers

SETTINGS = Settings("/arm", params={"~rate": 20, "~pid/gain": 1.5, "/limits": {"speed": 2}})


class Master:
    """A parameter server that takes no empty text, and keeps values by their whole names."""

    def __init__(self, peers: Peers) -> None:
        self.there: dict[str, Any] = {}
        self.nodes: list[str] = []
        self.silent = False
        self.peers = peers
        replies = {"getSystemState": self.state, "getParam": self.get, "setParam": self.set, "deleteParam": self.delete}
        self.environ = {"ROS_MASTER_URI": peers.api("master", replies, multicall=True)}

    @property
    def looks(self) -> int:
        """How many times somebody wanted to know what there is."""
        return self.peers.calls.count(("master", "getSystemState"))

    def state(self) -> list[Any]:
        return [-1, "not yet", 0] if self.silent else [1, "", [[["/rosout", self.nodes]], [], []]]

    def get(self, name: str) -> list[Any]:
        found = value_at(tree_of(self.there), name)
        return [-1, f"parameter [{name}] is not set", 0] if found is None else [1, "", found]

    def set(self, name: str, value: Any) -> list[Any]:
        if value == "":
            return [-1, "no empty text here", 0]
        self.there[name] = value
        return [1, "", 0]

    def delete(self, name: str) -> list[Any]:
        gone = [one for one in self.there if f"{one}/".startswith(f"{name}/")]
        for one in gone:
            del self.there[one]
        return [1, "", 0] if gone else [-1, f"parameter [{name}] is not set", 0]


@pytest.fixture
def master(peers: Peers) -> Master:
    return Master(peers)


def test_all_are_set_or_it_is_said_which_are_not(master: Master) -> None:
    def settings(**more: Any) -> dict[str, str]:
        given = {"node": "/arm", "expect_node": True, "params": {**SETTINGS.params, **more}}
        return {**master.environ, "ROSOPS_SETTINGS": json.dumps(given), "ROSOPS_NODE_NAME": "arm_1"}

    assert params.set_all(settings()) == ""
    assert master.there == {"/arm_1/rate": 20, "/arm_1/pid/gain": 1.5, "/limits": {"speed": 2}}
    assert params.set_all(settings(**{"~name": ""})) == "/arm_1/name: no empty text here"
    assert "does not answer" in params.set_all({**settings(), "ROS_MASTER_URI": "http://127.0.0.1:9"})
    assert "is not http://host:port" in params.set_all({**settings(), "ROS_MASTER_URI": "nowhere"})


def test_what_is_not_there_is_forgotten_already(master: Master, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_MASTER_URI", master.environ["ROS_MASTER_URI"])
    monkeypatch.delenv("ROSOPS_REVISION", raising=False)
    master.there = {"/arm/rate": 20, "/arm/own": 1, "/limits": {}}
    params.forget(SETTINGS, 5)
    assert master.there == {"/arm/own": 1, "/limits": {}}


# ---- kept


KEEPING = {
    "node": "/arm",
    "params": {"~rate": 20, "~pid": {"gain": 1.5}, "~off": 0, "/speed": 1},
    "keep_params": ["~rate", "~pid", "~tuned", "/speed"],
}
ONE, TWO, THREE = "11111111", "22222222", "33333333"


@pytest.fixture
def pod(master: Master, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Begins and ends versions of the settings, by their revisions. With `own` their node's name has it, too."""

    class Pod:
        own = False

        def _settings(self, revision: str, changes: dict[str, Any]) -> Settings:
            name, settings = f"arm_{revision}" if self.own else "arm", {**KEEPING, **changes}
            environ = {"ROSOPS_SETTINGS": json.dumps(settings), "ROSOPS_NODE_NAME": name, "ROSOPS_REVISION": revision}
            for key, value in {**master.environ, **environ}.items():
                monkeypatch.setenv(key, value)
            return load_settings(os.environ)

        def begin(self, revision: str, **changes: Any) -> None:
            """And its node registers."""
            node = self._settings(revision, changes).node
            assert params.set_all(os.environ) == ""
            master.nodes.append(node)

        def end(self, revision: str, **changes: Any) -> None:
            settings = self._settings(revision, changes)
            if settings.node in master.nodes:
                master.nodes.remove(settings.node)
            params.forget(settings, 5)

    return Pod()


FIRST = {"rate": 20, "pid/gain": 1.5, "off": 0}
TUNED = {"rate": 30, "pid/gain": 2.5, "tuned": 7}  # all that is kept
CLAIM = {"names": ["~rate", "~pid", "~tuned"]}


def under(node: str, values: dict[str, Any], **more: Any) -> dict[str, Any]:
    return {f"{node}/{name}": value for name, value in {**values, **more}.items()}


def leaves(master: Master) -> dict[str, Any]:
    """What is there, by whole names."""
    return dict(leaves_of(tree_of(master.there), ""))


@pytest.mark.parametrize("own", [False, True])
def test_the_first_start_has_the_inventorys_values(master: Master, pod: Any, own: bool, capfd: Any) -> None:
    pod.own = own
    pod.begin(ONE)
    told = under(f"/arm_{ONE}_kept", CLAIM) if own else {}
    assert leaves(master) == {**under(f"/arm_{ONE}" if own else "/arm", FIRST), **told, "/speed": 1}
    assert (master.looks, capfd.readouterr().err) == (1, "")


def test_beside_the_version_at_work(master: Master, pod: Any, capfd: Any) -> None:
    pod.own = True
    pod.begin(ONE)
    master.there.update({**under(f"/arm_{ONE}", TUNED, off=1, other=8), "/speed": 3})
    before = leaves(master)
    pod.begin(TWO)
    new = {**under(f"/arm_{TWO}", TUNED, off=0), **under(f"/arm_{TWO}_kept", CLAIM), "/speed": 3}
    assert leaves(master) == {**before, **new}
    names = f"/arm_{TWO}/rate, /arm_{TWO}/pid/gain, /speed"
    assert capfd.readouterr().err == f"rosops.fleet: kept as they were, not as params say: {names}\n"
    pod.end(ONE)
    assert leaves(master) == new
    pod.begin(TWO)  # its container once more
    assert leaves(master) == new


@pytest.mark.parametrize("own", [False, True])
@pytest.mark.parametrize("following", [ONE, TWO])
def test_after_the_version_before(master: Master, pod: Any, own: bool, following: str) -> None:
    pod.own = own
    node = f"/arm_{ONE}" if own else "/arm"
    pod.begin(ONE)
    master.there.update({**under(node, TUNED, off=1, other=8), "/speed": 3})
    pod.end(ONE)
    # what only the node has set under a name that others will have stays there, kept or not
    stays = {} if own else {"/arm/tuned": 7, "/arm/other": 8}
    assert leaves(master) == {**under(f"/arm_{ONE}_kept/values", TUNED), **stays, "/speed": 3}
    pod.begin(following)
    node = f"/arm_{following}" if own else "/arm"
    told = under(f"/arm_{following}_kept", CLAIM) if own else {}
    assert leaves(master) == {**stays, **under(node, TUNED, off=0), **told, "/speed": 3}


def test_a_way_back_from_a_version_that_keeps_less(master: Master, pod: Any) -> None:
    """The version before is not left with what that one was given, and who keeps nothing asks for nothing."""
    less: dict[str, Any] = {"params": {"~rate": 25, "~off": 1}, "keep_params": []}
    pod.begin(ONE)
    master.there.update(under("/arm", TUNED))
    pod.end(ONE)
    before = master.looks
    pod.begin(TWO, **less)
    pod.end(TWO, **less)
    assert master.looks == before
    left = {name: value for name, value in leaves(master).items() if ONE in name}
    assert left == under(f"/arm_{ONE}_kept/values", TUNED)
    pod.begin(ONE)
    assert leaves(master) == {**under("/arm", TUNED, off=0), "/speed": 1}


def test_without_the_master_no_value_of_the_inventory_is_set(master: Master, pod: Any) -> None:
    pod.begin(ONE)
    pod.end(ONE)
    master.there, master.silent = {}, True
    assert params.set_all(os.environ) == "not yet"
    assert master.there == {}


def test_what_cannot_be_kept_is_said_and_left_for_a_way_back(master: Master, pod: Any, capfd: Any) -> None:
    pod.begin(ONE)
    master.there.update(under("/arm", TUNED))
    pod.end(ONE)
    pod.begin(TWO, params={"~rate": "often", "~pid": {"gain": 0}})
    assert capfd.readouterr().err == (
        "rosops.fleet: kept as they were, not as params say: /arm/pid/gain\n"
        "rosops.fleet: not kept: /arm/rate was a number, and params say a text\n"
    )
    there = leaves(master)
    assert (there["/arm/rate"], there[f"/arm_{ONE}_kept/values/rate"]) == ("often", 30)


def test_what_may_be_any_versions_is_not_kept(master: Master, pod: Any, capfd: Any) -> None:
    master.there = {f"/arm_{ONE}/rate": 2, f"/arm_{THREE}/rate": 3}
    pod.begin(TWO)
    told = f"none is kept of /arm_{ONE}, /arm_{THREE}, as each may be the version before"
    assert capfd.readouterr().err == f"rosops.fleet: {told}\n"
    assert master.there["/arm/rate"] == 20
