# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The Lease of a robot: who changes it now. Runs and the keeper write it alike, as Kubernetes' electors do. Pure."""

from __future__ import annotations

from .objects import Object


def version_of(lease: Object | None) -> str:
    return str(((lease or {}).get("metadata") or {}).get("resourceVersion") or "")


def holder_of(lease: Object | None) -> str:
    return str(((lease or {}).get("spec") or {}).get("holderIdentity") or "")


def lease_with(holder: str, found: Object, me: str, seconds: int, at: str) -> Object:
    """The Lease to write, with this holder: `me`, or empty for nobody.

    `found` is what was read, or has metadata alone. The API refuses the write if somebody else made one since.
    """
    spec, ours = found.get("spec") or {}, holder_of(found) == me
    return {
        "apiVersion": "coordination.k8s.io/v1",
        "kind": "Lease",
        "metadata": found["metadata"],
        "spec": {
            **spec,
            "holderIdentity": holder,
            "leaseDurationSeconds": seconds,
            "renewTime": at,
            "acquireTime": spec.get("acquireTime", at) if ours else at,
            "leaseTransitions": int(spec.get("leaseTransitions") or 0) + (bool(spec) and not ours),
        },
    }
