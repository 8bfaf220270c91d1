# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The robot's Lease in the keeper's hand, while it changes something."""

from __future__ import annotations

from typing import Callable

from .._common.errors import FleetError
from .._step.lease import lease_with
from .._step.objects import Object
from .._step.words import KEEPER, LEASE, LEASE_SECONDS
from .cluster_api import Cluster


class LostError(FleetError):
    """Somebody else has the Lease."""


class Claim:
    """The Lease, as it was `found` and is from then on: the API refuses a write if somebody else made one since."""

    def __init__(self, cluster: Cluster, namespace: str, found: Object | None, at: Callable[[], str]) -> None:
        self.cluster, self.namespace, self.at = cluster, namespace, at
        self.found: Object = found or {"metadata": {"name": LEASE, "namespace": namespace}}
        self.lost = False

    def renew(self) -> None:
        """Before whatever is done next; LostError where it is another one's now."""
        self._write(KEEPER)
        if self.lost:
            raise LostError("somebody else changes it now")

    def release(self) -> None:
        if not self.lost:
            self._write("")

    def _write(self, holder: str) -> None:
        body = lease_with(holder, self.found, KEEPER, LEASE_SECONDS, self.at())
        written = self.cluster.write_lease(self.namespace, body)
        self.found, self.lost = written or self.found, written is None
