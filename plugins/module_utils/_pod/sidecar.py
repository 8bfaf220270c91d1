# SPDX-License-Identifier: GPL-3.0-or-later
"""The hooks of an app whose image has no Python: `run.py sidecar [--after NODE]`, in a container beside the app's.

The kubelet's probes and its preStop ask here by HTTP: a path is a command of ours, 200 that it ended well. A command
runs in a process of its own, so that what stays between a start and a stop is a bare interpreter. It sees of the app
what the pod's network shows, which is all that the hooks need. What a command has to say goes to this container's log.
"""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import sys

TYPE_CHECKING = False  # typing's own costs its import
if TYPE_CHECKING:
    from typing import Mapping

PORT = 11412
BACKLOG = 8
PATIENCE = 10.0  # s for a request to come
AT_ONCE, OF_ONE = 32, 8  # requests, each a process: of all, and of one address, the kubelet's among them
LONGEST = 4096  # bytes of it, of which the first line counts
FAILED, UNKNOWN = "503 Service Unavailable", "404 Not Found"


def requested(connection: socket.socket) -> str:
    """The path of its request line `GET /path HTTP/1.1` (RFC 9112, 3); empty: it is none. The whole head is read."""
    text = b""
    while b"\r\n\r\n" not in text and len(text) < LONGEST:
        part = connection.recv(LONGEST)
        if not part:
            break
        text += part
    words = text.split(b"\r\n", 1)[0].split(b" ")
    return words[1].decode("ascii", "replace") if len(words) == 3 and words[0] == b"GET" else ""


def respond(connection: socket.socket, known: Mapping[str, list[str]]) -> None:
    connection.settimeout(PATIENCE)
    words = known.get(requested(connection))
    status = UNKNOWN if words is None else FAILED if run_hook(words) else "200 OK"
    connection.sendall(f"HTTP/1.1 {status}\r\nContent-Length: 0\r\nConnection: close\r\n\r\n".encode())


def run_hook(words: list[str]) -> int:
    """The exit status of `run.py` with these words; its output is ours."""
    # there is no AnsibleModule in a pod, whose run_command would be called
    # pylint: disable-next=ansible-bad-function
    return os.spawnv(os.P_WAIT, sys.executable, [sys.executable, "-I", "-S", sys.argv[0], *words])  # noqa: S606


def bury(at_work: dict[int, str]) -> None:
    """Processes that have ended, those that others have left to the first one of the container, too."""
    with contextlib.suppress(ChildProcessError):
        while True:
            process, _status = os.waitpid(-1, os.WNOHANG)
            if not process:
                return
            at_work.pop(process, None)


def serve(listener: socket.socket, known: Mapping[str, list[str]]) -> None:
    """For ever; each request in a process of its own, as a stop may come while a start is looked at.

    Who has too many of them is hung up on, so that nobody takes the place of the kubelet.
    """
    at_work: dict[int, str] = {}  # process -> who asked
    while True:
        connection, (address, _port) = listener.accept()
        with connection:
            bury(at_work)
            if len(at_work) >= AT_ONCE or list(at_work.values()).count(address) >= OF_ONE:
                continue
            with contextlib.suppress(OSError):  # the pod has all the processes that it may: it is asked again
                process = os.fork()
                if process == 0:
                    try:
                        respond(connection, known)
                    finally:
                        os._exit(0)
                at_work[process] = address


def main(words: list[str]) -> int:
    signal.signal(signal.SIGTERM, lambda *_: os._exit(0))  # the first process of a container is deaf to it
    # path -> words for `run.py`; those of `exec` are ours: whose end the app's start waits for
    known = {"/begin": ["exec", *words], "/started": ["started"], "/stop": ["stop"]}
    with socket.create_server(("", PORT), backlog=BACKLOG) as listener:
        serve(listener, known)
    return 0
