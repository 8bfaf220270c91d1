# SPDX-License-Identifier: GPL-3.0-or-later
"""The keeper against a real master and real nodes: a killed node, one that only hangs."""

from __future__ import annotations

import json
import os
import signal
import time
from pathlib import Path

import pytest
from scene import Scene, until

NODES = ("/talker", "/listener", "/adder", "/worker", "/boss")


def start_all(scene: Scene) -> None:
    scene.start_master()
    # before the keeper, which reads them at its first look and then seldom
    scene.ros.calls([("setParam", "/tester", "/robot/wheels", 4), ("setParam", "/tester", "/robot/name", "r1")])
    scene.start_keeper()
    scene.start("talker", "/talker")
    scene.until_registered("/talker")
    scene.start("listener", "/listener")
    scene.start("service", "/adder")
    scene.start("server", "/worker")
    scene.start("client", "/boss", "/work", "1", "3", "4000")
    scene.until_recorded(*NODES)
    until("messages", lambda: scene.log("/listener")[-1]["count"] > 100)
    until("a goal under way", lambda: any("start" in line for line in scene.log("/worker")))


def _parameters(scene: Scene) -> str:
    path = Path(scene.directory, "record", "parameters.json")
    return str(json.loads(path.read_text())) if path.exists() else ""


def test_a_killed_node_is_removed_and_one_that_hangs_is_not(scene: Scene) -> None:
    start_all(scene)
    scene.start("listener", "/hanging")
    scene.until_recorded("/hanging")
    scene.kill("/hanging", signal.SIGSTOP)
    began = time.monotonic()
    scene.kill("/talker")
    until("the dead node's registrations to go", lambda: "/talker" not in scene.registered(), 40)
    took = time.monotonic() - began
    assert 5 <= took <= 30
    # each look at the dead one was a look at the one that hangs, too
    assert "/hanging" in scene.registered()
    assert set(scene.registered()) == {*NODES, "/hanging"} - {"/talker", "/boss"}  # that one is done by now
    scene.kill("/hanging", signal.SIGCONT)
    scene.start("talker", "/talker_2")
    until("messages for who hung", lambda: scene.log("/hanging")[-1]["count"] > 500, 40)


def test_what_it_costs_at_idle(scene: Scene) -> None:
    scene.start_master()
    keeper = scene.start_keeper()
    for number in range(10):
        scene.start("listener", f"/listener_{number}", f"/topic_{number}")
        scene.start("service", f"/server_{number}", f"/service_{number}")
    names = [f"/{kind}_{number}" for kind in ("listener", "server") for number in range(10)]
    until("20 nodes", lambda: set(names) <= set(scene.registered()), 60)
    scene.until_recorded(*names)
    until("its parameters", lambda: _parameters(scene))  # it has nothing to learn any more
    began, used = time.monotonic(), cpu_seconds(keeper.pid)
    time.sleep(15)
    share = (cpu_seconds(keeper.pid) - used) / (time.monotonic() - began)
    status = Path(f"/proc/{keeper.pid}/status").read_text()
    rss = next(line.split()[1] for line in status.splitlines() if line.startswith("VmRSS"))
    print(f"\nat idle with 20 nodes: {share:.2%} of a core, {int(rss) / 1024:.1f} MB")
    assert share < 0.01


def cpu_seconds(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def test_it_begins_anew_with_its_code_but_not_while_it_holds_goals(scene: Scene) -> None:
    """As the kubelet brings other files: by changing one link beside them."""
    link = scene.directory / "hooks" / "..data"
    link.parent.mkdir()
    link.symlink_to("..2026_01_01")
    start_all(scene)
    process, before = scene.processes["keeper"], scene.registered()
    scene.keeper_api.hold("/work", "/worker", 60.0)
    link.unlink()
    link.symlink_to("..2026_01_02")
    time.sleep(3.0)  # that nothing happens is what is looked for
    assert "begins anew" not in scene.said()
    scene.keeper_api.release("/work")
    until("the keeper to begin anew", lambda: scene.said().count("keeping ") == 2)
    until("the keeper", scene.keeper_ready)
    assert process.poll() is None
    assert scene.registered() == before
    assert scene.keeper_api.state()[2] == {}  # type: ignore[index]


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_it_ends_when_it_is_told_to(scene: Scene, number: int) -> None:
    scene.start_master()
    keeper = scene.start_keeper()
    keeper.send_signal(number)
    assert keeper.wait(5) == 0
    assert scene.said().endswith("stopped\n")
