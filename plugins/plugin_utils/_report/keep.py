# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Keep in a cluster what became of its hosts: of one as soon as it is known, of all in the end of a run."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Mapping
from typing import Any

from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import KubeError
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.client import Kube
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.connection import ApiError
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.files import noted_run
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.kept import REF, kept_object, kept_part

PATIENCE = 10.0  # for a word about what is over


def keep(kube: Kube, rows: Iterable[Mapping[str, Any]]) -> None:
    """Rows as `kept_part` takes them; other hosts' keys stay."""
    part = kept_part(rows)
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
    run = {key: noted_run().get(key, "") for key in ("playbook", "started")}
    row = {**run, "host": host, "outcome": outcome, "reason": reason, "changed": int(changed), "failed_task": None}
    with contextlib.suppress(KubeError):
        keep(kube.within(PATIENCE), [row])
