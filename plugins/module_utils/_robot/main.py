# SPDX-License-Identifier: GPL-3.0-or-later
"""The keeper's process: `run.py keeper --record DIRECTORY`, where it keeps its files.

It is not replaced with the code in its ConfigMap: when that has changed, and nobody needs it, it begins anew by itself.
Beside an external master it has `--keep off`: it looks at the graph, and gives nothing back to that master by itself.
On a robot without ROS it has `--keep none`, and an empty graph.
"""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import threading
import time
from typing import Callable, Mapping

from .._common.errors import KubeError, printable
from .._exporter import exporter
from .._ros.client import Ros1Client
from .._ros.keeper_client import KeeperCalls
from .._ros.raw_node import Said, Slave
from .._ros.registrar import Registrar
from .._ros.rpc import address_of
from .._step.words import FLEET, KEEPER_PORT, PATH
from .cluster_api import ACCOUNT, Cluster
from .door import Door
from .goal_forwarding import SWITCHED_OFF, Calls, GoalForwarding
from .holds import Holds
from .keeper import Keeper, Lifeline
from .latched_topics import LatchedTopics
from .memory import KeptFiles, boot_of_host
from .open_goals import Staying
from .readiness import CALLER, AllGates, Readiness
from .step_watch import Robot, StepWatch

NAME = "/ros_keeper"
TIMEOUT = 2.0
LOOKS = 8  # at once, of a shared master's keeper
STACK = 512 * 1024  # bytes; of the 8 MB that are usual some kernels keep more than what is in use
ENDING = (signal.SIGTERM, signal.SIGINT)
WAKING = signal.SIGUSR1  # to itself: the master has ended
ANEW = -1  # what main returns to be begun anew


def tell(text: str) -> None:
    """As one line, whatever names of others are in it: who reads the log takes a line of JSON for an update."""
    exporter.say(f"{time.strftime('%Y-%m-%dT%H:%M:%SZ', time.gmtime())} {printable(' '.join(text.split()))}")


def options(words: list[str]) -> dict[str, str]:
    """`--name value` pairs."""
    found = {
        "--record": "/tmp/ros-keeper",  # noqa: S108 - by hand
        "--port": str(KEEPER_PORT),
        "--goal-forwarding": "on",
        "--account": ACCOUNT,
        "--keep": "on",
        **exporter.OPTIONS,
    }
    given = dict(zip(words[::2], words[1::2]))
    if not given.keys() <= found.keys():
        raise SystemExit(f"usage: keeper [{'] ['.join(f'{known} VALUE' for known in found)}]")
    return {**found, **given}


def told_to_end(seconds: float) -> bool:
    """Wait, unless woken; whether the end has come."""
    came = signal.sigtimedwait((*ENDING, WAKING), seconds)
    return came is not None and came.si_signo != WAKING


def code_of(script: str) -> str:
    """What tells the files beside the script from others: the kubelet brings those by changing one link there."""
    try:
        return os.readlink(f"{script.rpartition('/')[0]}/..data")
    except OSError:  # by hand, without a ConfigMap
        return ""


def no_master(uri: str) -> Calls:
    """The ROS master of a robot without ROS, the keeper itself, says that nobody has registered anything.

    So its graph is empty, for everybody who asks (wiki: ROS/Master_API), besides what every node answers.
    """
    return {
        "getUri": lambda _caller: [1, "", uri],
        "getSystemState": lambda _caller: [1, "", [[], [], []]],
        "getTopicTypes": lambda _caller: [1, "", []],
        "getParam": lambda _caller, _key: [1, "", {}],
    }


def main(words: list[str]) -> int:
    # Waited for, not handled: a handler that sets an Event in the middle of its wait() waits for itself. Before any
    # thread starts, because it inherits what is blocked.
    signal.pthread_sigmask(signal.SIG_BLOCK, (*ENDING, WAKING))
    threading.stack_size(STACK)
    chosen, code = options(words), code_of(sys.argv[0])
    uri = os.environ.get("ROS_MASTER_URI", "http://localhost:11311")
    slave = Slave(NAME, os.environ.get("ROS_IP", ""), int(chosen["--port"]), uri)
    if chosen["--keep"] == "none":
        uri = slave.master_uri = slave.uri
        slave.register(no_master(uri))
    shown = exporter.Exporter(uri, chosen, tell)
    slave.show(exporter.PATH, shown.metrics)
    return keep(slave, shown, chosen, code)


def keep(slave: Slave, shown: exporter.Exporter, chosen: Mapping[str, str], code: str) -> int:
    """All that is done for the robots of one master, until it is told to end, or its code has changed."""
    uri, keeps = slave.master_uri, chosen["--keep"] == "on"
    kept, ros = KeptFiles(chosen["--record"], tell), Registrar(uri, TIMEOUT, NAME)
    keeper = Keeper(ros, kept, tell, uri=slave.uri, boot=boot_of_host(), keeps=keeps)
    keeper.held = Lifeline(address_of(uri, "http"), lambda: os.kill(os.getpid(), WAKING)).hold
    slave.show("/ready", lambda _asked: Said(200 if keeper.complete else 503))
    slave.register({"paramUpdate": keeper.parameter_changed, "is_whole": keeper.was_whole})
    cluster: Cluster | None = None
    try:
        cluster = Cluster(os.environ, chosen["--account"])
    except KubeError as error:  # the keeper does all the rest without
        tell(f"no step of an update is taken back from here: {error}")
    calls = SWITCHED_OFF  # what an earlier one held, with another option, is over
    if keeps and chosen["--goal-forwarding"] == "on":
        stays = Staying(cluster) if cluster else lambda _action, _server: True
        forwarding = GoalForwarding(ros, slave, lambda content: kept.save("goals", content), tell, stays)
        forwarding.resume(kept.load("goals") or [])
        calls = forwarding.calls
    slave.register(calls)
    latched = LatchedTopics(ros, slave, kept, tell) if keeps else None
    if latched:
        latched.resume()
        slave.register({"keep_latched": latched.keep})
    watch = None
    beside: list[Callable[[], None]] = []
    if cluster:
        client = Ros1Client(uri, TIMEOUT, NAME)
        holds = Holds(cluster, client, KeeperCalls(slave.uri, NAME), kept)
        robot = Robot(calls["hold"], calls["release"], keeper.take_back, lambda: keeper.silence, holds.watch)
        watch = StepWatch(cluster, client, robot, kept, tell)
        slave.show(PATH, Door(holds, watch.left_over, keeper.is_whole).page)
        beside = [watch.run, all_gates(cluster, keeper, latched).run]
    slave.start()
    shown.start()
    for work in beside:
        threading.Thread(target=work, daemon=True).start()
    tell(f"keeping {uri}: {len(keeper.memory.nodes)} nodes on record, calls at {slave.uri}")
    pause = 0.0
    while not told_to_end(pause):
        if code_of(sys.argv[0]) != code and not calls["state"]()[2] and (watch is None or watch.rests()):
            tell("its code has changed: it begins anew")
            return ANEW
        try:
            pause = keeper.step()
        except Exception as error:  # whatever one look brings, the next one may be better
            tell(f"error: {type(error).__name__}: {error}")
            pause = 1.0
    tell("stopped")
    return 0


def all_gates(cluster: Cluster, keeper: Keeper, latched: LatchedTopics | None) -> AllGates:
    """The readiness gates of all namespaces; of a master that is somebody else's nothing is kept that was latched."""
    keep_latched = latched.keep if latched else lambda *_: []
    ros = Ros1Client(keeper.ros.uri, TIMEOUT, CALLER)
    # a whole fleet's pods may start at once, and each look has its graph in memory
    turn = threading.BoundedSemaphore(LOOKS) if cluster.home == FLEET else contextlib.nullcontext()

    def made(namespace: str) -> Readiness:
        return Readiness(cluster, namespace, ros, keep_latched, keeper, tell, turn=turn)

    return AllGates(cluster, made)
