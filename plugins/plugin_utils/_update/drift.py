# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What somebody changed by hand: a Deployment that says it is the wanted one, and is not; a Service that is gone. Pure.

`kubectl set image` and `kubectl scale` leave the annotations with our hashes as they are. The API server adds defaults
and writes quantities its own way, so what differs here is a suspicion; a dry run of the apply says whether it is one.
What was put beside our fields (`kubectl set env`, a second container, a pause) is seen by who owns it.
"""

from __future__ import annotations

from collections.abc import Iterable

from ...module_utils._step.objects import hash_of, is_in
from ...module_utils._step.record import UNPROVEN, answer, soaks
from .._kube.applied import foreign_fields, left_fields
from .._model import names
from .revisions import key_of, read_records
from .world import Live, Object


def suspects(wanted: Iterable[Object], live: Live) -> list[Object]:
    """Of the Deployments that are wanted those that are there by their hash, but not by what they say."""
    there, records = {key_of(item): item for item in live.deployments}, read_records(live.maps)
    return [
        item
        for item in wanted
        if (found := there.get(key_of(item))) is not None
        and hash_of(found) == hash_of(item)
        and (answer(found, records) not in UNPROVEN or soaks(found, records))  # a step applies the others again anyway
        and _is_changed(item, found)
    ]


def lost_services(wanted: Iterable[Object], live: Live) -> list[Object]:
    """Of the Services that are wanted those of running Deployments that are not there, or are not what was applied.

    No pod works by one that is gone: to apply it again disturbs nobody.
    """
    running, there = {key_of(item) for item in live.deployments}, {key_of(item): item for item in live.services}
    return [
        item
        for item in wanted
        if item["kind"] == "Service" and key_of(item) in running
        if (found := there.get(key_of(item))) is None or _is_changed(item, found)
    ]


def _is_changed(wanted: Object, there: Object) -> bool:
    beside = foreign_fields(there, wanted, names.MANAGER) or left_fields(there, wanted, names.MANAGER)
    return bool(beside) or not is_in(wanted["spec"], there["spec"])
