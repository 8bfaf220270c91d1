# SPDX-License-Identifier: GPL-3.0-or-later
"""The servers of a host's cluster, as its task asks them; and the token that they share.

k3s takes a new token on its command line alone, or makes one itself. So it makes it, and it is on none.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from ...module_utils._common.documents import Arguments, Variables
from ...module_utils._common.errors import KubeError
from ...module_utils._host.k3s import BINARY, CONFIG_DIR, DATA_DIR, token_password, without_secrets
from .._upstream import ansible_core

KEPT = f"{CONFIG_DIR}/token"  # with which k3s is started
RUNS = f"{DATA_DIR}/server/token"  # k3s' own word: with which it was started, or what it has made since


def on_server(action: Any, known: Variables, server: str, *command: str) -> str:
    """What a command on a server printed; KubeError where it said nothing of use. Nothing of it is shown."""
    return _done(action, known, server, {"ansible.builtin.command": {"argv": [*command]}})


def _done(action: Any, known: Variables, server: str, task: Arguments) -> str:
    asked = {**task, "delegate_to": server, "become": True, "no_log": True, "check_mode": False}
    found = ansible_core.run_task(action, known, asked)
    if found.get("failed") or found.get("unreachable"):
        raise KubeError(without_secrets(str(found.get("stderr") or found.get("msg") or "it failed").strip()[-300:]))
    return str(found.get("stdout", "")).strip()


@dataclass(frozen=True)
class SharedToken:
    """The token of a cluster's servers, as passwords: the newest one is what k3s has on the first of them."""

    newest: str
    kept: dict[str, str]  # server -> with which its k3s starts next
    agreed: bool  # it is the newest one on all of them, and with it all have started


def shared_token(action: Any, known: Variables, servers: Sequence[str]) -> SharedToken:
    """KubeError where a server does not say."""
    kept, runs = dict[str, str](), dict[str, str]()
    for server in servers:
        try:
            lines = on_server(action, known, server, "grep", "-h", ".", KEPT, RUNS).splitlines()
            kept[server], runs[server] = map(token_password, lines)
        except (KubeError, ValueError) as error:
            raise KubeError(f"the servers' token cannot be read on {server}: {error}") from error
    newest = runs[servers[0]]
    return SharedToken(newest, kept, {*kept.values(), *runs.values()} == {newest})


def rotate_token(action: Any, known: Variables, servers: Sequence[str]) -> None:
    """Another token. It is written for all servers at once, as none starts with the old one from now on."""
    for server in servers:  # snapshots of before need the old one
        on_server(action, known, server, "cp", "-p", KEPT, f"{KEPT}.previous")
    on_server(action, known, servers[0], BINARY, "token", "rotate")
    text = on_server(action, known, servers[0], "cat", RUNS)
    for server in servers:
        _done(action, known, server, {"ansible.builtin.copy": {"dest": KEPT, "content": f"{text}\n", "mode": "0600"}})
