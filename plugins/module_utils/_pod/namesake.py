# SPDX-License-Identifier: GPL-3.0-or-later
"""A new version that starts beside the old one, and begins when the process that has its node's name has ended.

The master evicts whoever has a name that another one registers, and of what only one may do (a device, an action's
server) there would be two. So a pod whose node has one name through all versions waits here, with its image, volumes
and sandbox there already, whoever stops the old one. The old process ends after it has left the graph: a connection to
it, over which nothing is said, shows the moment.
"""

from __future__ import annotations

import contextlib
import http.client
import os
import shutil
import socket
import time
import xmlrpc.client
from typing import Callable

from .._common.errors import RefusalError, RosError
from .._ros.rpc import Api, Deadline, address_of
from .exec import ATTEMPT, PATIENCE, PAUSE

CALLER = "/rosops_fleet_exec"
ANSWER = 2.0  # s for the master
LOOK = 5.0  # s between two looks whether the name is the other one's still


def wait_for_its_end(
    master: str,
    node: str,
    own: str,
    now: Callable[[], float] = time.monotonic,
    sleep: Callable[[float], None] = time.sleep,
) -> None:
    """Until nobody beside this pod, whose address is `own`, has the name of this node, or nobody can tell."""
    end = now() + PATIENCE
    while now() < end:
        try:
            host, port = who_has(master, node)
        except (OSError, RosError, http.client.HTTPException, xmlrpc.client.Error):
            sleep(PAUSE)
            continue
        if host in ("", own) or not outlasts(host, port):
            return
        end = now() + PATIENCE


def who_has(master: str, node: str) -> tuple[str, int]:
    """Where the node of this name is, or no host: nobody is called that."""
    try:
        with Api(master, CALLER, Deadline(ANSWER)) as api:
            return address_of(api.call("lookupNode", node), "http")
    except RefusalError:
        return "", 0


def outlasts(host: str, port: int) -> bool:
    """Whether somebody listens there; returns when that process ends, or is to be looked up again."""
    try:
        line = socket.create_connection((host, port), ATTEMPT)  # where it takes longer the pod has gone
    except (OSError, UnicodeError):  # the latter: a host that no name can have
        return False
    with line, contextlib.suppress(OSError):
        line.settimeout(LOOK)
        line.recv(1)
    return True


def wait(node: str, command: str = "") -> None:
    """As the pod's environment says. A command that is not there shows at once, not when the old version has gone."""
    if not command or shutil.which(command):
        wait_for_its_end(os.environ["ROS_MASTER_URI"], node, os.environ.get("ROS_IP", ""))
