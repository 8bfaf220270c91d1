# SPDX-License-Identifier: GPL-3.0-or-later
"""The keeper's process: the files that it was begun from, and what it is composed of."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._robot import main
from ansible_collections.rosops.fleet.plugins.module_utils._robot.cluster_api import Cluster
from ansible_collections.rosops.fleet.plugins.module_utils._robot.keeper import Keeper
from ansible_collections.rosops.fleet.plugins.module_utils._robot.main import code_of
from ansible_collections.rosops.fleet.plugins.module_utils._robot.memory import KeptFiles
from ansible_collections.rosops.fleet.plugins.module_utils._ros import jobs
from ansible_collections.rosops.fleet.plugins.module_utils._ros.keeper_client import KeeperCalls
from ansible_collections.rosops.fleet.plugins.module_utils._ros.raw_node import Slave
from ansible_collections.rosops.fleet.plugins.module_utils._ros.registrar import Registrar
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.pod_settings import rest_maps
from ansible_collections.rosops.fleet.tests.unit.plugins.fake_action import FakeClient, FakeMaster, FakeServer
from ansible_collections.rosops.fleet.tests.unit.plugins.fake_ros import Peers, until
from ansible_collections.rosops.fleet.tests.unit.plugins.module_utils._robot.cluster_around import (
    environment,
    start_server,
)
from ansible_collections.rosops.fleet.tests.unit.plugins.module_utils._robot.robot_at_the_door import SPACE, rosops_may
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._kube.kube_server import END
from ansible_collections.rosops.fleet.tests.unit.robots import robot
from pod_code import write_code


def volume(directory: Path, version: str) -> None:
    """A ConfigMap's volume with this version of its files, laid out as the kubelet does it."""
    (directory / version).mkdir()
    (directory / version / "run.py").write_text(version)
    (directory / "..data_tmp").symlink_to(version)
    (directory / "..data_tmp").rename(directory / "..data")
    if not (directory / "run.py").exists():
        (directory / "run.py").symlink_to("..data/run.py")


def test_other_files_than_it_was_begun_from_are_noticed(tmp_path: Path) -> None:
    volume(tmp_path, "..2026_01_01")
    begun = code_of(str(tmp_path / "run.py"))
    volume(tmp_path, "..2026_01_02")
    assert code_of(str(tmp_path / "run.py")) != begun
    assert code_of(str(tmp_path / "by hand" / "run.py")) == ""  # no kubelet brings others there


def test_each_namespace_has_gates_and_a_thread_of_its_own_and_a_whole_fleets_take_turns(tmp_path: Path) -> None:
    for home, bound in (("robot-r1", None), ("fleet", main.LOOKS)):
        (tmp_path / home).mkdir()
        api = start_server(tmp_path / home, home)
        cluster = Cluster(environment(api), str(tmp_path / home))
        keeper = Keeper(Registrar("http://master:11311"), KeptFiles(str(tmp_path), main.tell), main.tell)
        every = main.all_gates(cluster, keeper, None)
        api.put("/api/v1/namespaces/fleet/configmaps/robot-r1", {"metadata": {}})
        pods = [f"/api/v1/namespaces/{one}/pods" for one in dict.fromkeys((home, "robot-r1"))]
        try:
            every.look()
            assert sorted(api.next_watch()[0] for _namespace in every.gates) == pods
        finally:
            for one in every.gates.values():
                one.over = True
            for path in pods:
                api.events(path).put(END)
            api.stop()
        one, other = every.gates["robot-r1"], every.made("robot-r2")
        assert (one.namespace, one.ros.uri, one.keeper) == ("robot-r1", "http://master:11311", keeper)
        assert one.keep_latched("/a", "http://a:1/", 1.0) == []
        assert (one.turn is other.turn) and (one.ros is other.ros) and getattr(one.turn, "_value", None) == bound


def test_a_robot_without_ros_is_one_whose_graph_is_empty() -> None:
    """By the real client, over a real socket."""
    slave = Slave("/ros_keeper", "127.0.0.1", 0, "")
    slave.register(main.no_master(slave.uri))
    slave.start()
    try:
        at = {"master_uri": slave.uri}
        found = jobs.graph(at)["graph"]
        assert not any(found[part] for part in ("nodes", "topics", "services", "actions", "launched"))
        assert jobs.ready({**at, "nodes": [], "timeout": 1.0})["verdict"] == "pass"
        assert jobs.ready({**at, "nodes": ["/a"], "timeout": 0.0})["verdict"] == "wait"
        asked = {**at, "actions": [], "seconds": 60.0, "timeout": 1.0, "interval": 0.1}
        assert jobs.JOBS["hold"](asked)["verdict"] == "pass"
        ros = Registrar(slave.uri)
        assert ros.snapshot() == {}
        _pid, *said = ros.calls([("getPid", ros.caller), ("getUri", ros.caller), ("getParam", ros.caller, "/")])
        assert said == [slave.uri, {}]
    finally:
        slave.stop()


def test_who_holds_the_robot_through_its_door_holds_its_goals(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The keeper's own process, an action on loopback, an API server with TLS, and `rosops-may`."""
    may, peers, code = rosops_may(), Peers(), tmp_path / "code"
    code.mkdir()
    write_code(code)
    api, master = start_server(tmp_path, SPACE), FakeMaster(peers)
    client, server = FakeClient(master), FakeServer(master)
    (rest,) = rest_maps(robot({"name": "worker", "image": "a:1", "pattern": "action"}))
    api.put(f"/api/v1/namespaces/{SPACE}/configmaps/robot-rest", rest)
    around = {**environment(api), "ROS_MASTER_URI": master.uri, "ROS_IP": "127.0.0.1"}
    for key, value in around.items():
        monkeypatch.setenv(key, value)
    monkeypatch.delenv("KUBECONFIG", raising=False)
    monkeypatch.setattr(may, "ACCOUNT", tmp_path)
    options = ["--record", str(tmp_path / "record"), "--port", "0", "--account", str(tmp_path)]
    words = [sys.executable, "-I", "-S", str(code / "run.py"), "keeper", *options]
    around = {**os.environ, **around}
    keeper = subprocess.Popen(words, stdout=subprocess.PIPE, text=True, env=around)  # noqa: S603 - our own
    try:
        assert keeper.stdout
        begun = next(line for line in keeper.stdout if "calls at" in line)  # however long a busy machine takes to it
        ask = ["robot1", "--url", re.findall(r"calls at (http://\S+)/$", begun)[0]]
        until(lambda: may.main(ask) == 0)
        calls = KeeperCalls(ask[-1], "/pod")  # a pod's: what it saw now counts, what it saw before the keeper came not
        assert [calls.is_whole(age) for age in (0.0, 3600.0)] == [True, False]
        assert KeeperCalls(master.uri, "/pod").is_whole(3600.0)  # who has no such call says nothing against it
        assert may.main([*ask, "--owner", "me", "--hold", "60"]) == 0
        client.send("one")
        assert may.main(ask) == 75
        assert server.got == []
        assert may.main([*ask, "--owner", "me", "--release"]) == 0
        until(lambda: server.got == ["one"])
        assert may.main(ask) == 75  # at work
    finally:
        keeper.terminate()
        keeper.communicate(timeout=60)
        server.end(master)
        client.stop()
        peers.close()
        api.stop()


def test_what_it_tells_is_one_line_whatever_a_node_is_called(capsys: pytest.CaptureFixture[str]) -> None:
    main.tell('removed /x\n{"event": "update"}\x9b2J')
    told = capsys.readouterr().out
    assert told.count("\n") == 1
    assert told.endswith('Z removed /x {"event": "update"}\\x9b2J\n')
