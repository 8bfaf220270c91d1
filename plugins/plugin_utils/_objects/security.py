# SPDX-License-Identifier: GPL-3.0-or-later
"""What a container may do on its host. Pure."""

from __future__ import annotations

from collections.abc import Sequence

from ...module_utils._step.objects import Object
from .._model.app import App

ALL = ("ALL",)
# Of an app, whose image is not ours and mostly runs as root: what a ROS node has no use for. Raw sockets let a pod
# speak in another one's name on the pods' network. What entrypoints and drivers do use (files of other users, changing
# the user) stays.
APPS = ("AUDIT_WRITE", "MKNOD", "NET_RAW", "SETFCAP", "SETPCAP", "SYS_CHROOT")
# For a privileged container the API refuses to have escalation forbidden.
_MIGHTY = frozenset({"SYS_ADMIN", "CAP_SYS_ADMIN"})


def harden(container: Object, drop: Sequence[str]) -> None:
    """Fill in what its own securityContext, overrides included, leaves open; a privileged one is left as it is."""
    given: Object = dict(container.get("securityContext") or {})
    asked = given.get("capabilities") or {}
    added = {*(asked.get("add") or ())}
    # container runtimes add first and drop then, but for ALL, which they drop before: what is asked for by name is kept
    capabilities = {"drop": [one for one in drop if one not in added and "ALL" not in added], **asked}
    if given.get("privileged") or _MIGHTY & added:
        return
    container["securityContext"] = {
        "allowPrivilegeEscalation": False,
        "seccompProfile": {"type": "RuntimeDefault"},
        **given,
        "capabilities": capabilities,
    }


def more_than_baseline(app: App) -> str:
    """What of an app the level `baseline` of Kubernetes' Pod Security Standards forbids, or nothing."""
    asked = {
        "devices": app.devices,
        "host_paths": app.host_paths,
        "host_network": app.host_network,
        "host_port": [port for port in app.ports if port.host_port],
    }
    return ", ".join(key for key, value in asked.items() if value)
