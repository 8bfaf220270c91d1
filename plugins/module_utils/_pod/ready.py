# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The readiness probe: does the pod's own node answer, and does the app's own command agree?

It asks the address that the start found and no master, so that a master that is away makes no app unready. By hand over
a socket: xmlrpc.client would double the probe's price.
"""

from __future__ import annotations

import os
import re
import socket
import sys
import time

from .command import run_command
from .state import load_settings, load_state

TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any, Callable

TIMEOUT = 2.0
COMMAND_TIMEOUT = 5.0
MAX_REPLY = 65536
_BODY = (
    b"<?xml version='1.0'?><methodCall><methodName>getPid</methodName><params><param><value><string>/rosops_fleet_ready"
    b"</string></value></param></params></methodCall>"
)
_NUMBER = re.compile(rb"<(?:int|i4)>\s*(-?[0-9]+)\s*</")


def main(_words: list[str]) -> int:
    reason = unready(load_settings(os.environ), process_at, run_command, _find_again)
    if reason:
        sys.stdout.write(f"not ready: {reason}\n")
    return 1 if reason else 0


def unready(
    settings: dict[str, Any],
    ask: Callable[[str], int],
    run: Callable[[list[str], float], str],
    find: Callable[[dict[str, Any]], str],
) -> str:
    """Why the app is not ready, or nothing. `find` looks for a node that is not where it was, or says why not."""
    if settings["expect_node"]:
        known = load_state(settings["node"])
        try:
            same = bool(known.get("uri")) and ask(known["uri"]) == known.get("pid")
        except (OSError, ValueError):
            same = False
        reason = "" if same else find(settings)
        if reason:
            return reason
    return run(settings["command"], COMMAND_TIMEOUT) if settings["command"] else ""


def _find_again(settings: dict[str, Any]) -> str:
    """A node may have been started anew within its container; this way is dear, and only taken then."""
    from .own_node import find_node  # noqa: PLC0415

    return find_node(settings)[1]


def process_at(uri: str, timeout: float = TIMEOUT) -> int:
    """The process id that the node at this address gives; OSError or ValueError where none does."""
    host, _colon, port = uri.partition("://")[2].partition("/")[0].rpartition(":")
    end = time.monotonic() + timeout
    with socket.create_connection((host.strip("[]"), int(port)), timeout) as sock:
        head = (
            f"POST / HTTP/1.1\r\nHost: {host}:{port}\r\nContent-Type: text/xml\r\nContent-Length: {len(_BODY)}\r\n\r\n"
        )
        sock.sendall(head.encode() + _BODY)
        reply = b""
        while b"</methodResponse>" not in reply:
            sock.settimeout(max(end - time.monotonic(), 0.001))
            part = sock.recv(4096)
            reply += part
            if not part or len(reply) > MAX_REPLY:
                raise ValueError("no whole reply")
    numbers = _NUMBER.findall(reply)
    # [1, "", process id]: a failure has another code, a fault has no such list
    if len(numbers) != 2 or numbers[0] != b"1":
        raise ValueError("no process id")
    return int(numbers[1])
