# SPDX-License-Identifier: GPL-3.0-or-later
"""What launch files started, and what became of it, by the word of the roslaunch processes themselves.

Each roslaunch leaves its address on the parameter server under `/roslaunch/uris`; nobody takes it away, so most of them
are dead. It answers `list_processes` and `process_info` (roslaunch/server.py, pmon.py). The latter has all environment
variables of the process in it, too: nothing is taken from it but what `Child` has.

Our own launcher (`_pod/launch.py`, what `ros_apps[].launch` starts) keeps how its processes have ended. Any other
roslaunch forgets one that has ended and is not started again, a tenth of a second later: its name stays, its exit code
does not, and nobody can tell a node that has done its work from one that crashed; but for a registration that it has
left behind.
"""

from __future__ import annotations

import re
import signal
from dataclasses import dataclass
from functools import partial
from typing import Any, Callable, Container, Iterable, Mapping

from .graph import Graph, host_of
from .replies import rows, unwrap
from .rpc import MAX_THREADS, Api, Deadline, Master, in_parallel

URIS = "/roslaunch/uris"  # host_<address with _>__<port> -> URI

_NUMBER = re.compile(r"-\d+\Z")  # that roslaunch puts behind a node's name


@dataclass(frozen=True)
class Child:
    """A process that a launch file started.

    `name` is roslaunch's for it, `host` the address of its pod. `exit_code` as of Popen: negative is a signal, None is
    not known. `respawn` and `required` are those of the launch file; both are False of a process that roslaunch has
    forgotten. `spawned`: how many times it was started.
    """

    name: str
    host: str
    alive: bool
    exit_code: int | None
    respawn: bool
    required: bool
    spawned: int

    @property
    def node(self) -> str:
        """The name of its node in the graph: roslaunch leaves the first slash out and puts a number behind.

        >>> Child("arm/lidar-3", "10.42.0.7", True, None, False, False, 1).node
        '/arm/lidar'
        """
        return "/" + _NUMBER.sub("", self.name).lstrip("/")


def crash(child: Child, graph: Graph = Graph()) -> str:  # noqa: B008 - it is frozen
    """What is wrong with a process, in words that follow its name; nothing where it lives, has done its work, or nobody
    can tell. One that has ended well takes its registrations out of the `graph`.
    """
    again = f"was started again {child.spawned - 1} time{'s'[: child.spawned > 2]}" if child.spawned > 1 else ""
    if child.alive or child.exit_code == 0:
        return again
    # its node is registered at its host, where nothing listens any more
    left = (node.refused and host_of(node.uri) == child.host for node in graph.named(child.node))
    if child.exit_code is not None:
        ended = f"ended with {how(child.exit_code)}"
    else:
        ended = "died, as its registration is still there" if any(left) else ""
    return " and ".join(part for part in (again, ended) if part)


def how(exit_code: int) -> str:
    """
    >>> how(3), how(-11)
    ('exit code 3', 'signal SIGSEGV')
    """
    if exit_code >= 0:
        return f"exit code {exit_code}"
    try:
        return f"signal {signal.Signals(-exit_code).name}"
    except ValueError:
        return f"signal {-exit_code}"


# ---- asking


def children(ros: Master, hosts: Container[str], at_once: int = MAX_THREADS) -> list[Child]:
    """The processes of all roslaunch at these addresses, by host and name.

    One question to the master where nobody ever launched anything. A roslaunch that is gone, or does not answer within
    the master's time-out, has no processes here. No more than so many are asked `at_once`. RosError where the master
    does not answer.
    """
    told = ros.calls([("getParam", ros.caller, URIS)])[0]  # a RosError where there is none
    uris = {uri for uri in told.values() if isinstance(uri, str)} if isinstance(told, Mapping) else ()
    tasks: dict[Any, Callable[[], list[Child]]] = {
        uri: partial(_ask, uri, host_of(uri), ros.caller, ros.timeout) for uri in uris if host_of(uri) in hosts
    }
    answers = in_parallel(tasks, ros.timeout, lambda _uri, _error: [], at_once)
    return sorted((child for part in answers.values() for child in part), key=lambda child: (child.host, child.name))


def _ask(uri: str, host: str, caller: str, seconds: float) -> list[Child]:
    with Api(uri, caller, Deadline(seconds)) as api:
        # none of its methods takes a caller
        listed = list(processes(unwrap(api.raw("list_processes"))))
        infos = api.calls([("process_info", name) for name, _alive, _spawned in listed])
        return [child_of(host, name, alive, spawned, info) for (name, alive, spawned), info in zip(listed, infos)]


def processes(listed: Any) -> Iterable[tuple[str, bool, int]]:
    """Name, whether roslaunch still minds it, and how many times it was started, from list_processes' value."""
    parts = listed[:2] if isinstance(listed, (list, tuple)) else ()
    for part, alive in zip(parts, (True, False)):
        for name, spawned, *_more in rows(part, 2):
            if isinstance(name, str) and isinstance(spawned, int):
                yield name, alive, spawned


def child_of(host: str, name: str, minded: bool, spawned: int, info: Any) -> Child:
    """`info` is process_info's value, or the RosError that roslaunch has forgotten the process."""
    told = info if isinstance(info, Mapping) else {}
    code = told.get("exit_code")
    return Child(
        name,
        host,
        # it minds one, too, that has ended and that it will start again
        minded and told.get("alive") is not False,
        code if isinstance(code, int) else None,
        told.get("respawn") is True,
        told.get("required") is True,
        spawned,
    )
