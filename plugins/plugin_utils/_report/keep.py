# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Keep in a cluster what became of its hosts: of one as soon as it is known, of all in the end of a run."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable

from ...module_utils._common.errors import KubeError
from .._kube.client import Kube
from .._kube.connection import ApiError
from .._update.outcome import RobotOutcome
from .files import noted_run
from .host_run import HostRun
from .kept import REF, kept_object, kept_part

PATIENCE = 10.0  # for a word about what is over


def keep(kube: Kube, runs: Iterable[HostRun]) -> None:
    """What runs made of these hosts; other hosts' keys stay."""
    part = kept_part(runs)
    if kube.get(REF) is None:
        try:
            kube.create(kept_object(part))
            return
        except ApiError as error:
            if error.status != 409:  # another run was faster
                raise
    kube.merge(REF, part)


def keep_early(kube: Kube, host: str, outcome: str, reason: str, changed: bool) -> None:
    """For a run that is killed before its end, where this is written again; so only there it is said if it fails."""
    run = noted_run()
    found = HostRun(host, run.playbook, run.started, RobotOutcome(outcome, reason), int(changed))
    with contextlib.suppress(KubeError):
        keep(kube.within(PATIENCE), [found])
