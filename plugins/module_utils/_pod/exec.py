# SPDX-License-Identifier: GPL-3.0-or-later
"""The app's own command, begun once its master can be reached: `run.py exec [--after NODE] [COMMAND...]`.

A pod may be faster than its host with the Service of a new master. The kernel then tracks the first connection without
the Service's translation, and all that it repeats of it, too: a node whose first look-up meets that moment hangs for
127 s (tcp_syn_retries of tcp(7)). So it is looked with connections that are each a new one, and only then the process
becomes the app's. The kernel keeps what it tracked for 120 s (nf_conntrack_tcp_timeout_syn_sent). A later connection
from the same port fails by it, so the ports of these are none that a connection gets by itself (ip_local_port_range). A
master that is away for long is the app's own business. `--after`: nor before another process of this node's name has
ended (`namesake.py`), nor without its parameters, where it has some (`params.py`). Without a command this ends when one
could begin (`sidecar.py`).
"""

from __future__ import annotations

import os
import signal
import socket
import sys
import time

TYPE_CHECKING = False  # typing's own costs its import
if TYPE_CHECKING:
    from typing import Mapping

PATIENCE = 30.0  # s for a master that does not answer
ATTEMPT = 0.5  # s for a connection, which takes milliseconds
PAUSE = 0.1
FIRST_PORT, PORTS = 20000, 10000  # of Linux' 32768 and up, and of NodePorts, none
AFTER = "--after"
UNSET, UNAVAILABLE, NOT_FOUND, STOPPED = 1, 126, 127, 128 + signal.SIGTERM  # as shells say it


def address_of(environ: Mapping[str, str]) -> tuple[str, int]:
    rest = environ.get("ROS_MASTER_URI", "http://localhost:11311").partition("://")[2]
    host, _colon, port = rest.partition("/")[0].rpartition(":")
    return host.strip("[]"), int(port)


def reachable(address: tuple[str, int], seconds: float = PATIENCE) -> bool:
    """Whether somebody listens there within that time."""
    end = time.monotonic() + seconds
    while True:
        try:
            socket.create_connection(address, ATTEMPT, ("", _own_port())).close()
        except OSError:
            if time.monotonic() >= end:
                return False
            time.sleep(PAUSE)
        else:
            return True


def _own_port() -> int:
    """Another one each tenth of a second, in whichever process of the pod."""
    return FIRST_PORT + int(time.time() * 10) % PORTS


def main(words: list[str]) -> int:
    """Does not return if there is a command that can be started."""
    node, words = (words[1], words[2:]) if words[:1] == [AFTER] else ("", words)
    signal.signal(signal.SIGTERM, lambda *_: os._exit(STOPPED))  # the first process of a container is deaf to it
    try:
        address = address_of(os.environ)
    except ValueError:
        address = ("", 0)  # whatever that is, the app's ROS will say it better
    params = '"params"' in os.environ.get("ROSOPS_SETTINGS", "")
    there = False
    while address[0] and not (there := reachable(address)):
        sys.stderr.write(f"rosops.fleet: no ROS master at {address[0]}:{address[1]} for {PATIENCE:.0f} s\n")
        sys.stderr.flush()
        if not params:
            break
    if there and node:
        from .namesake import wait as wait_for_namesake  # noqa: PLC0415 - it takes longer to load than all else here

        wait_for_namesake(node, *words[:1])
    if params:
        from .params import set_all  # noqa: PLC0415 - as above

        unset = set_all(os.environ)
        if unset:
            sys.stderr.write(f"rosops.fleet: its parameters are not set: {unset}\n")
            return UNSET
    if not words:
        return 0
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    signal.signal(signal.SIGPIPE, signal.SIG_DFL)  # Python ignores it, and a process inherits that
    try:
        os.execvp(words[0], words)  # noqa: S606 - the command of the app's own specification
    except OSError as error:
        sys.stderr.write(f"rosops.fleet: cannot start {words[0]}: {error.strerror}\n")
        return NOT_FOUND if isinstance(error, FileNotFoundError) else UNAVAILABLE
