# SPDX-License-Identifier: GPL-3.0-or-later
"""A robot without ROS is one whose graph is empty: by the real client, over a real socket."""

from __future__ import annotations

from ansible_collections.rosops.fleet.plugins.module_utils._robot import no_master
from ansible_collections.rosops.fleet.plugins.module_utils._ros import jobs
from ansible_collections.rosops.fleet.plugins.module_utils._ros.raw_node import Slave
from ansible_collections.rosops.fleet.plugins.module_utils._ros.registrar import Registrar


def test_its_keeper_answers_as_a_master_at_which_nobody_has_registered() -> None:
    slave = Slave("/ros_keeper", "127.0.0.1", 0, "")
    slave.register(no_master.methods(slave.uri))
    slave.start()
    try:
        at = {"master_uri": slave.uri}
        found = jobs.graph(at)["graph"]
        assert {part: found[part] for part in ("nodes", "topics", "services", "actions", "launched")} == {
            "nodes": {}, "topics": {}, "services": {}, "actions": {}, "launched": [],
        }  # fmt: skip
        assert jobs.ready({**at, "nodes": [], "timeout": 1.0})["verdict"] == "pass"
        assert jobs.ready({**at, "nodes": ["/a"], "timeout": 0.0})["verdict"] == "wait"
        asked = {**at, "actions": [], "seconds": 60.0, "timeout": 1.0, "interval": 0.1}
        assert jobs.JOBS["hold"](asked)["verdict"] == "pass"
        ros = Registrar(slave.uri)
        assert ros.snapshot() == {}
        assert ros.calls([("getPid", ros.caller), ("getUri", ros.caller), ("getParam", ros.caller, "/")])[1:] == [
            slave.uri,
            {},
        ]
    finally:
        slave.stop()
