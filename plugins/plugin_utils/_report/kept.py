# SPDX-License-Identifier: GPL-3.0-or-later
"""What the last runs made of the hosts, as their cluster keeps it for whoever looks next, from wherever.

One ConfigMap for a cluster, with a key for each host: runs on different hosts do not write over each other. The steps
of updates are in the robots' own ConfigMaps, which the engine writes.
"""

from __future__ import annotations

import contextlib
import json
import time
from collections.abc import Iterable, Sequence
from itertools import chain
from operator import attrgetter

from ...module_utils._common.documents import json_of
from ...module_utils._common.errors import KubeError
from ...module_utils._step.objects import Object, labels_of, name_of
from ...module_utils._step.update_record import RUNNING, WAITING
from .._kube.cache import Ref
from .._kube.client import Kube
from .._kube.connection import ApiError
from .._kube.pods import meta
from .._model import names
from .._objects.common import config_map, owner_labels
from .._update.outcome import Event, RobotOutcome, known_events
from .host_run import SPOILT, HostRun, note_of, noted_run
from .rows import LastRun, Step

REF = Ref("ConfigMap", names.OUTCOMES, "kube-system", "v1")
REASON_KEPT = 500  # a ConfigMap holds 1 MiB, and a fleet has many hosts
PATIENCE = 10.0  # for a word about what is over


def keep(kube: Kube, runs: Iterable[HostRun]) -> None:
    """What runs made of these hosts, without steps, which the robot's own record has; other hosts' keys stay."""
    data = {}
    for run in runs:
        told = {**run.as_dict(), "reason": run.outcome.reason[:REASON_KEPT]}
        del told["steps"]
        data[run.host] = json.dumps(told, sort_keys=True)
    if kube.get(REF) is None:
        try:
            kube.create(config_map(REF.name, REF.namespace, owner_labels(None), data))
            return
        except ApiError as error:
            if error.status != 409:  # another run was faster
                raise
    kube.merge(REF, {"data": data})


def keep_early(kube: Kube, host: str, outcome: str, reason: str, changed: bool) -> None:
    """For a run that is killed before its end, where this is written again; so only there it is said if it fails."""
    run = noted_run()
    found = HostRun(host, run.playbook, run.started, RobotOutcome(outcome, reason), int(changed))
    with contextlib.suppress(KubeError):
        keep(kube.within(PATIENCE), [found])


def last_runs(maps: Iterable[Object]) -> list[LastRun]:
    """What the newest run that had the host made of it, by host; what somebody spoilt is left out.

    A host that went to another cluster is kept in both; of runs that began together the last one counts.
    """
    runs = []
    kept = (one for one in maps if (meta(one).get("namespace"), name_of(one)) == (REF.namespace, REF.name))
    for text in chain(*((one.get("data") or {}).values() for one in kept)):
        with contextlib.suppress(*SPOILT):
            runs.append(HostRun.from_dict(json_of(text)))
    newest = {run.host: run for run in sorted(runs, key=attrgetter("started")) if run.outcome.outcome}
    rows = []
    for host, run in sorted(newest.items()):
        note = note_of(run.outcome.reason, run.failed_task)
        rows.append(LastRun(host, run.outcome.outcome, run.playbook, run.started, run.changed, note))
    return rows


def last_steps(maps: Iterable[Object]) -> list[Step]:
    """The latest step of each app, a robot's in their order; what somebody spoilt is left out.

    Of a robot that went to another cluster the later record counts.
    """
    robots = ((str(labels_of(one).get(names.LABEL_ROBOT) or ""), one) for one in maps)
    records = ((robot, sorted(known_events([one], robot), key=_started)) for robot, one in robots)
    newest = dict(sorted((record for record in records if record[1]), key=lambda record: _started(record[1][-1])))
    steps = []
    for robot, events in sorted(newest.items()):
        with contextlib.suppress(*SPOILT):
            steps += [_step(robot, events, name) for name in dict.fromkeys(event.get("id") for event in events)]
    return steps


def _step(robot: str, events: Sequence[Event], name: object) -> Step:
    """The step of this id; each event is of one of its apps."""
    own = [event for event in events if event.get("id") == name]
    begun = [event for event in own if event.get("outcome") in (RUNNING, WAITING)]
    before, after = (
        tuple(f"{one.get(f'{side}_image') or ''} ({one[side]})" for one in own if one.get(side))
        for side in ("from", "to")
    )
    told, phases = own[0], {key: float(seconds) for key, seconds in (own[0].get("phases") or {}).items()}
    title, handoff, outcome, reason = (str(told.get(key) or "") for key in ("step", "handoff", "outcome", "reason"))
    if begun:
        reason = time.strftime("begun %Y-%m-%dT%H:%M:%SZ", time.gmtime(_started(begun[-1])))
    seconds, wait = round(sum(phases.values()), 3), phases.get("wait", 0.0)
    return Step(robot, title, handoff, outcome, before, after, seconds, wait, reason)


def _started(event: Event) -> float:
    return float(event["started"])
