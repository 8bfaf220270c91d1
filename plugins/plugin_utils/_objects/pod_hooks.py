# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What an app's pod gets of the collection's own code: the volume, the probes, the stop hook. Pure."""

from __future__ import annotations

from typing import Any, Mapping

from ansible_collections.rosops.fleet.plugins.plugin_utils._model import names

FOR_EVER = 1_000_000  # failures: a node that is not connected yet is no reason to kill its container


def hook_command(word: str) -> list[str]:
    """A command of the in-pod code. Isolated: neither the image's Python variables nor its site packages matter to it.

    >>> hook_command("ready")
    ['python3', '-I', '-S', '/opt/rosops-fleet/hooks/run.py', 'ready']
    """
    return ["python3", "-I", "-S", f"{names.HOOKS_DIR}/run.py", word]


def hook_mount() -> dict[str, Any]:
    """Where the code appears in a container."""
    return {"name": names.HOOKS_NAME, "mountPath": names.HOOKS_DIR, "readOnly": True}


def hook_volume(app: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """The code; for an app with its settings, and its contract while a step of an update is under way."""
    maps: list[dict[str, Any]] = [{"name": names.HOOKS_NAME}]
    if app is not None:
        if app["scope"] == "fleet":
            maps.append({"name": names.fleet_hooks_name(app["name"])})
        contract = {"key": "contract.json", "path": "contract.json"}
        maps.append({"name": names.update_name(app["name"]), "items": [contract], "optional": True})
    return {"name": names.HOOKS_NAME, "projected": {"sources": [{"configMap": item} for item in maps]}}


def app_probes() -> dict[str, Any]:
    """The container's fields that call the code.

    `started` looks every tenth of a second by itself and answers before its time-out, so that Kubernetes' one second
    does not count; until it has passed there is no other probe. `ready` costs a start of Python and one call.
    """
    return {
        "startupProbe": _probe("started", period=1, timeout=45, failures=FOR_EVER),
        "readinessProbe": _probe("ready", period=10, timeout=10, failures=3),
        "lifecycle": {"preStop": {"exec": {"command": hook_command("stop")}}},
    }


def _probe(word: str, period: int, timeout: int, failures: int) -> dict[str, Any]:
    return {
        "exec": {"command": hook_command(word)},
        "periodSeconds": period,
        "timeoutSeconds": timeout,
        "failureThreshold": failures,
    }
