# SPDX-License-Identifier: GPL-3.0-or-later
"""What is asked of a robot's ROS graph, and done to it: by the steps of an update, and by users of modules.

The keeper's door does it in the keeper, the collection's modules do it on the robot's host. Arguments and results are
those of modules: plain data, with the address of the master in `master_uri`. FleetError where it cannot be done.
"""

from __future__ import annotations

import time
from dataclasses import asdict
from typing import Callable, Mapping

from .._common.documents import Arguments, Data
from .._common.errors import SpecError
from .._common.poll import PASS, Polled, Seen, poll
from . import idle_robot, registrar
from .backend import around, everything
from .bus_stats import rates as counted
from .client import Ros1Client
from .conditions import WAIT_ARGS, conditions_from
from .gate import Look, Silence, look
from .graph import Graph, Rate, host_of
from .graph_json import graph_data
from .listener import Listener
from .roslaunch import children, crash

INFO_ARGS: dict[str, Data] = {
    "nodes": {"type": "list", "elements": "str", "default": []},
    "rates": {"type": "bool", "default": False},
    "rate_source": {"type": "str", "choices": ["messages", "counters"], "default": "messages"},
    "rate_topics": {"type": "list", "elements": "str"},
    "rate_nodes": {"type": "list", "elements": "str", "default": []},
    "rate_seconds": {"type": "float", "default": 2.0},
    "md5sums": {"type": "bool", "default": False},
    "definitions": {"type": "bool", "default": False},
    "launch_hosts": {"type": "list", "elements": "str", "default": []},
}


def _master(arguments: Arguments) -> Ros1Client:
    return Ros1Client(arguments["master_uri"], *filter(None, [arguments.get("node_timeout")]))


def _whole(arguments: Arguments, spec: Mapping[str, Data]) -> Data:
    """With the defaults of what was left out."""
    return {**{name: one.get("default") for name, one in spec.items()}, **arguments}


# ---- the graph


def graph(arguments: Arguments) -> Data:
    """The `graph` (`graph_json`), with what was asked for beside it, and the seconds that it took (`elapsed`)."""
    params, start = _whole(arguments, INFO_ARGS), time.monotonic()
    if not 0 < params["rate_seconds"] <= 3600:
        raise SpecError(f"rate_seconds: {params['rate_seconds']} is not between 0 and 3600 s")
    return {"changed": False, "graph": read(_master(arguments), params), "elapsed": round(time.monotonic() - start, 3)}


def read(ros: Ros1Client, params: Arguments) -> Data:
    """`params` are all of INFO_ARGS."""
    state = ros.state(types=True)
    found = ros.ask(state, around(state, params["nodes"]) if params["nodes"] else everything(state))
    heard = found.heard(params["rate_nodes"])
    measured = found.measured(
        _rates(ros, heard, params) if params["rates"] else {},
        ros.handshakes(found, heard.topics) if params["md5sums"] else {},
    )
    return {**graph_data(measured, params["definitions"]), "launched": _launched(ros, found, params)}


def _launched(ros: Ros1Client, found: Graph, params: Arguments) -> list[Data]:
    """What launch files have started in the pods of the wanted nodes, or of all, and in those that are named.

    Only there: an address of a pod that is gone would be waited for, and nobody takes it from the parameter server.
    """
    wanted = [node for name in params["nodes"] or found.names for node in found.named(name)]
    hosts = {*params["launch_hosts"], *(host_of(node.uri) for node in wanted)}
    return [{**asdict(one), "node": one.node, "crash": crash(one, found)} for one in children(ros, hosts)]


def _rates(ros: Ros1Client, heard: Graph, params: Arguments) -> dict[str, Rate]:
    """The rates of what is wanted of the publishers that are heard, by topic."""
    named = heard.topics if params["rate_topics"] is None else params["rate_topics"]
    wanted, seconds = [name for name in named if name in heard.topics], float(params["rate_seconds"])
    if params["rate_source"] == "counters":
        return counted(ros, heard, wanted, seconds)
    return ros.rates(heard, dict.fromkeys(wanted, seconds), patient=True)


# ---- until it is what it should be


def ready(arguments: Arguments) -> Data:
    """Wait until all conditions (options of ros_ready) hold. Where they do not, `msg` names those."""
    params, silence = _whole(arguments, WAIT_ARGS), Silence()
    conditions = conditions_from(params)
    ros = _master(arguments)
    ears = Listener(ros, conditions.values) if conditions.values else None

    def probe() -> Seen:
        seen = look(ros, conditions, silence, ears.checks if ears else None)
        return Seen(seen.verdict, seen)

    try:
        ended = poll(probe, params["timeout"], params["interval"], params["consecutive"], stable=params["stable"])
    finally:
        if ears:
            ears.close()
    last: Look = ended.last
    found = {
        "changed": False,
        "ready": ended.verdict == PASS,
        "verdict": ended.verdict,
        "elapsed": round(ended.elapsed, 3),
        "looks": ended.looks,
        "held": round(ended.held, 3),
        "checks": [asdict(check) for check in last.checks],
    }
    return found if found["ready"] else {**found, "msg": _why(ended, params["consecutive"], params["stable"])}


def _why(ended: Polled, consecutive: int, stable: float) -> str:
    """Every condition that is not met, in one message."""
    last: Look = ended.last
    took = f"after {ended.elapsed:.1f} s"
    if not last.unmet and ended.passes >= consecutive:
        return f"The ROS graph was ready for {ended.held:.1f} of {stable:g} s without a break {took}"
    if not last.unmet:
        return f"The ROS graph was ready in {ended.passes} of {consecutive} looks in a row {took}"
    verb = "is not ready" if ended.timed_out else "cannot become ready"
    return f"The ROS graph {verb} {took}: " + "; ".join(str(check) for check in last.unmet)


JOBS: Mapping[str, Callable[[Arguments], Data]] = {
    "graph": graph,
    "ready": ready,
    "hold": idle_robot.hold,
    "release": idle_robot.release,
    "register": registrar.register,
    "reap": registrar.reap,
}
