# SPDX-License-Identifier: GPL-3.0-or-later
"""Action servers replaced under clients that send goals back to back: none lost, aborted or executed twice."""

from __future__ import annotations

import os
import signal
import subprocess
from typing import Any

import pytest
from scene import LOST, RECALLED, SUCCEEDED, Scene, until

HANDOVERS = int(os.environ.get("ROSOPS_HANDOVERS", "8"))
ACTION, SERVER = "/work", "/worker"


class Server:
    """The present server's process, replaced as Kubernetes and the stop hook do it."""

    def __init__(self, scene: Scene, kind: str = "server") -> None:
        self.scene, self.kind, self.number = scene, kind, 0
        self.process = self.start()

    def start(self) -> subprocess.Popen[bytes]:
        self.number += 1
        self.process = self.scene.start(self.kind, SERVER, ACTION, log=f"server_{self.number}")
        return self.process

    def stop(self) -> None:
        """By the stop hook of its pod, which has the keeper hold the goals that come."""
        assert self.scene.run_stop_hook(SERVER) == ""

    def executed(self) -> list[dict[str, Any]]:
        return [line for number in range(1, self.number + 1) for line in self.scene.log(f"server_{number}")]


def held(scene: Scene) -> dict[str, Any]:
    found: dict[str, Any] = scene.keeper_api.state()[2]  # type: ignore[operator,index,assignment]
    return found


def let_go(scene: Scene) -> None:
    until("the keeper to let go", lambda: not held(scene), 30)


def begin(scene: Scene, kind: str = "server", **clients: tuple[str, str]) -> Server:
    """Master, keeper, server, and clients: name -> (first goal's number, milliseconds of each)."""
    scene.start_master()
    scene.start_keeper()
    server = Server(scene, kind)
    until("the server", lambda: SERVER in scene.registered())
    for name, (first, milliseconds) in clients.items():
        scene.start("client", f"/{name}", ACTION, first, milliseconds)
        until(f"goals of {name}", lambda name=name: len(goals(scene, name)) > 2)  # type: ignore[misc]
    return server


def goals(scene: Scene, client: str) -> list[dict[str, Any]]:
    return [line for line in scene.log(client) if "goal" in line]


def end_clients(scene: Scene, *clients: str) -> list[dict[str, Any]]:
    """Every client finishes the goal that it waits for; all that they saw."""
    for name in clients:
        scene.kill(f"/{name}", signal.SIGUSR1)
    for name in clients:
        until(f"{name} to end", lambda name=name: scene.log(name)[-1].get("ended"), 70)  # type: ignore[misc]
    return [goal for name in clients for goal in goals(scene, name)]


def judge(server: Server, sent: list[dict[str, Any]]) -> None:
    """Each goal has succeeded by its client's word, and was executed once by the servers'."""
    started = [line["start"] // 100000 for line in server.executed() if "start" in line]
    broken = [line for line in server.executed() if "broken" in line]
    wrong = [goal for goal in sent if not goal["done"] or goal["state"] != SUCCEEDED]
    lost = {goal["goal"] for goal in sent} - set(started)
    twice = len(started) - len(set(started))
    assert (wrong, sorted(lost), broken, twice) == ([], [], [], 0)


def test_hand_overs(scene: Scene) -> None:
    server = begin(scene, boss=("1000", "20"))
    for _turn in range(HANDOVERS):
        server.stop()
        server.start()
        let_go(scene)
        done = len(goals(scene, "boss"))
        until("goals after the hand-over", lambda done=done: len(goals(scene, "boss")) > done + 3)  # type: ignore[misc]
    judge(server, end_clients(scene, "boss"))
    assert scene.said().count("forwarded /") >= HANDOVERS - 2  # the goals did come this way


def test_several_clients(scene: Scene) -> None:
    server = begin(scene, "pool", a=("1000", "100"), b=("4000", "150"), c=("7000", "230"))
    for turn in range(HANDOVERS // 4):
        server.stop()
        scene.start("client", f"/late_{turn}", ACTION, str(10000 + 2000 * turn), "200")  # and one more each time
        until("the newcomer", lambda turn=turn: f"/late_{turn}" in scene.registered())  # type: ignore[misc]
        server.start()
        let_go(scene)
        until("goals of the newcomer", lambda turn=turn: len(goals(scene, f"late_{turn}")) > 3)  # type: ignore[misc]
    judge(server, end_clients(scene, "a", "b", "c", *(f"late_{turn}" for turn in range(HANDOVERS // 4))))


def test_a_goal_that_is_cancelled_while_it_is_held(scene: Scene) -> None:
    server = begin(scene)
    scene.start("canceller", "/canceller", ACTION)
    until("the client", lambda: scene.log("canceller"))
    server.stop()
    scene.kill("/canceller", signal.SIGUSR1)
    until("the cancel", lambda: "was cancelled while it is held" in scene.said())
    server.start()
    answer = until("the server's answer", lambda: goals(scene, "canceller"))[0]
    # LOST where the new server's first status reaches the client before the cancel reaches the server: the client
    # library gives up a goal that it has cancelled as soon as a status does not list it
    assert (answer["done"], answer["state"] in (RECALLED, LOST)) == (True, True)
    let_go(scene)
    assert not [line for line in server.executed() if "start" in line]


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_the_keeper_is_restarted_in_the_middle(scene: Scene, number: int) -> None:
    server = begin(scene, boss=("1000", "20"))
    server.stop()
    until("the goal to be held", lambda: held(scene)[ACTION]["held"])
    scene.kill("keeper", number)
    scene.processes["keeper"].wait()
    scene.start_keeper()
    assert len(held(scene)[ACTION]["held"]) == 1
    server.start()
    let_go(scene)
    judge(server, end_clients(scene, "boss"))


def test_the_master_is_restarted_in_the_middle(scene: Scene) -> None:
    server = begin(scene, boss=("1000", "20"))
    scene.until_recorded("/boss", SERVER)
    server.stop()
    until("the goal to be held", lambda: held(scene)[ACTION]["held"])
    scene.kill("master")
    until("the keeper to see it", lambda: "the master is away" in scene.said())
    scene.start_master()
    server.start()
    let_go(scene)
    judge(server, end_clients(scene, "boss"))
