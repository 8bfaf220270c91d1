# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a pod gets of the collection's own code: the volume, the probes, the command that stops its node. Pure."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ansible_collections.rosops.fleet.plugins.plugin_utils._model import names
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.context import App
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.common import Object, mount

FOR_EVER = 1_000_000  # failures: a node that is not connected yet is no reason to kill its container
# Characters that only a shell gives a meaning: a readiness command with one of them is a script, else a path.
SHELL_CHARACTERS = frozenset(" \t\n;&|<>()$`\"'*?[]{}~#!\\")


def code_command(word: str) -> list[str]:
    """A command of the in-pod code. Isolated: neither the image's Python variables nor its site packages matter to it.

    >>> code_command("ready")
    ['python3', '-I', '-S', '/opt/rosops-fleet/hooks/run.py', 'ready']
    """
    return ["python3", "-I", "-S", f"{names.CODE_DIR}/run.py", word]


def code_mount() -> Object:
    """Where the code appears in a container."""
    return mount(names.CODE_NAME, names.CODE_DIR, read_only=True)


def code_volume(app: App | None = None) -> Object:
    """The code; for an app with its contract, which is there while a step of an update is under way."""
    maps: list[dict[str, Any]] = [{"name": names.CODE_NAME}]
    if app is not None:
        contract = {"key": "contract.json", "path": "contract.json"}
        maps.append({"name": names.update_name(app.name), "items": [contract], "optional": True})
    return {"name": names.CODE_NAME, "projected": {"sources": [{"configMap": item} for item in maps]}}


def app_probes() -> Object:
    """The container's fields that call the code.

    `started` looks every tenth of a second by itself and answers before its time-out, so that Kubernetes' one second
    does not count; until it has passed there is no other probe. `ready` costs a start of Python and one call.
    """
    return {
        "startupProbe": _probe("started", period=1, timeout=45, failures=FOR_EVER),
        "readinessProbe": _probe("ready", period=10, timeout=10, failures=3),
        "lifecycle": {"preStop": {"exec": {"command": code_command("stop")}}},
    }


def probe_command(command: str | Sequence[str]) -> list[str]:
    """readiness.command as an exec command: a list and a path as they are, a script through a shell.

    >>> probe_command("/usr/local/bin/readiness_probe.sh")
    ['/usr/local/bin/readiness_probe.sh']
    >>> probe_command("test -f /tmp/ready")
    ['/bin/sh', '-c', 'test -f /tmp/ready']
    """
    if isinstance(command, str):
        return ["/bin/sh", "-c", command] if SHELL_CHARACTERS & set(command) else [command]
    return [str(word) for word in command]


def _probe(word: str, period: int, timeout: int, failures: int) -> Object:
    return {
        "exec": {"command": code_command(word)},
        "periodSeconds": period,
        "timeoutSeconds": timeout,
        "failureThreshold": failures,
    }
