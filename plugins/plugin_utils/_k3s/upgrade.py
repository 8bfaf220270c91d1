# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""From one version of k3s to another: what is allowed, and what pods notice of it. Pure.

Kubernetes takes one minor version after the other and no way back: the datastore is written in the newer one's form. A
kubelet must not be newer than the API that it talks to.
"""

from __future__ import annotations

from collections.abc import Sequence

from .._model.machines import CGROUP_V2_FROM, version


def refusal(
    installed: str, wanted: str, servers: Sequence[str] = (), back_to: str = "", cgroup_refused: bool = False
) -> str:
    """Why a host does not go from one version to the other; empty where it may.

    `installed` is empty where there is no k3s, `wanted` where it is not known beforehand. `servers` are the versions of
    the servers that the host is an agent of. `back_to` is the version that an unproven change replaced: it may always
    come back. `cgroup_refused` is what k3s_info says of the host.
    """
    return (
        (_step_refusal(installed, wanted) if wanted != back_to else "")
        or _skew_refusal(wanted, servers)
        or (_cgroup_refusal(installed, wanted) if cgroup_refused else "")
    )


def restarts_pods(installed: str, wanted: str) -> bool:
    """Whether the kubelet of another minor version may start all containers again, as that of 1.31 did."""
    old, new = version(installed), version(wanted)
    return old is not None and new is not None and old.minor != new.minor


def _step_refusal(installed: str, wanted: str) -> str:
    old, new = version(installed), version(wanted)
    if old is None or new is None:
        return ""
    if old.newer_than(new):
        return (
            f"k3s {wanted} is older than {installed}, which runs there: its datastore and Node are of the newer one. "
            f"Set k3s_version to {installed} or newer (k3s_airgap_dir likewise); the way back to an older one is a "
            "snapshot, see the role k3s."
        )
    if new.minor[0] == old.minor[0] and new.minor[1] - old.minor[1] > 1:
        following = f"v{old.minor[0]}.{old.minor[1] + 1}"
        return (
            f"From k3s {installed} to {wanted} a minor version is skipped, which Kubernetes does not support. "
            f"Go to a version {following}.x first."
        )
    return ""


def _cgroup_refusal(installed: str, wanted: str) -> str:
    """What runs there with cgroup v1 has somebody who saw to that."""
    old, new = version(installed), version(wanted)
    if new is None or new.minor < CGROUP_V2_FROM or (old and old.minor >= CGROUP_V2_FROM):
        return ""
    return (
        f"k3s {wanted} does not start on this host, which has cgroup v1: from 1.35 on the kubelet wants v2. Boot it "
        "with systemd.unified_cgroup_hierarchy=1 on the kernel's command line, or allow v1 (the role k3s says how)."
    )


def _skew_refusal(wanted: str, servers: Sequence[str]) -> str:
    new = version(wanted)
    older = [text for text in servers if new and (known := version(text)) and new.newer_than(known)]
    if not older:
        return ""
    return (
        f"k3s {wanted} is newer than its cluster's servers ({', '.join(dict.fromkeys(older))}); an agent must not be. "
        "Bring the servers to that version first: rosops.fleet.site without --limit."
    )
