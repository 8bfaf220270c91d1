# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Whose cluster it is: a ConfigMap in kube-system says it, and a run compares it before it believes anything. Pure.

Two inventories may well have hosts, robots and clusters of the same names, so only the fleet's own name tells their
clusters apart.
"""

from __future__ import annotations

from dataclasses import dataclass

from ...module_utils._common.errors import KubeError
from ...module_utils._step.objects import Object
from .._model import names
from .._model.fleet import UNNAMED
from .cache import Ref

REF = Ref("ConfigMap", "rosops-fleet", "kube-system", "v1")


class WrongClusterError(KubeError):
    """The access leads to a cluster that is not the inventory's, or to one that cannot be told to be."""


@dataclass(frozen=True)
class Identity:
    """The fleet's name (`fleet_name`) and the cluster's within it."""

    fleet: str
    cluster: str

    def __str__(self) -> str:
        return f"the cluster {self.cluster} of the fleet {self.fleet}"

    def as_object(self) -> Object:
        """The ConfigMap that says it."""
        return {
            "apiVersion": REF.api_version,
            "kind": REF.kind,
            "metadata": {
                "name": REF.name,
                "namespace": REF.namespace,
                "labels": {"app.kubernetes.io/managed-by": names.MANAGER},
            },
            "data": {"fleet": self.fleet, "cluster": self.cluster},
        }


def identity_in(found: Object | None) -> Identity | None:
    """What a cluster's ConfigMap says; nothing where it has none."""
    data = (found or {}).get("data") or {}
    return Identity(str(data.get("fleet")), str(data.get("cluster"))) if {"fleet", "cluster"} <= set(data) else None


def to_be_adopted(found: Identity | None, wanted: Identity, own: bool, where: str) -> bool:
    """Whether the cluster is ours and does not say so yet; WrongClusterError where it is not known to be ours.

    `own`: the access was fetched from the cluster's own server. That proves a cluster which has no identity yet, or
    that of a fleet without a name, to be the inventory's; it does not prove that a host was not given to another fleet.
    `where` names the API and whence the access to it is.
    """
    if found == wanted:
        return False
    if own and found in (None, Identity(UNNAMED, wanted.cluster)):
        return True
    if found is None:
        raise WrongClusterError(
            f"{where} leads to a cluster that carries no fleet's identity; the inventory's is {wanted}. Nothing was "
            "read or changed. If it is that one, run the stage node of rosops.fleet.site once without this access: the "
            "run then fetches its access from the cluster's own server, and writes the identity."
        )
    raise WrongClusterError(
        f"{where} leads to {found}; the inventory's is {wanted}. Nothing was read or changed. "
        + (
            f"If hosts or names have changed on purpose, delete the {REF} there (k3s kubectl on the server), and run "
            "rosops.fleet.site."
            if own
            else "Take that access away, or use the other inventory."
        )
    )
