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

from ...module_utils._common.errors import KubeError
from ...module_utils._step.objects import Object, labels_of
from ...module_utils._step.update_record import RUNNING, WAITING
from .._kube.cache import Ref
from .._kube.client import Kube
from .._kube.connection import ApiError
from .._model import names
from .._objects.common import config_map, owner_labels
from .._update.outcome import Event, RobotOutcome, StepResult, known_events
from .host_run import SPOILT, HostRun, noted_run

REF = Ref("ConfigMap", "rosops-outcomes", "kube-system", "v1")
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


def kept_runs(found: Object | None) -> list[HostRun]:
    """The last run of each host; what somebody spoilt is left out."""
    runs = []
    for text in ((found or {}).get("data") or {}).values():
        try:
            runs.append(HostRun.from_dict(json.loads(text)))
        except SPOILT:
            continue
    return runs


def kept_steps(maps: Sequence[Object]) -> list[HostRun]:
    """The latest step of each app, as a run without an outcome; what somebody spoilt is left out."""
    runs = []
    for item in maps:
        robot = str(labels_of(item).get(names.LABEL_ROBOT) or "")
        events = sorted(known_events([item], robot), key=_started)
        try:
            steps = tuple(_step(events, name) for name in dict.fromkeys(event.get("id") for event in events))
        except SPOILT:
            continue
        if steps:
            runs.append(HostRun(robot, "", _utc(_started(events[-1])), RobotOutcome("", steps=steps)))
    return runs


def _step(events: Sequence[Event], name: object) -> StepResult:
    """Of the step of this id; each event is of one of its apps."""
    own = [event for event in events if event.get("id") == name]
    begun = [event for event in own if event.get("outcome") in (RUNNING, WAITING)]
    sides = {
        side: {one["app"]: {"image": one.get(f"{side}_image"), "revision": one[side]} for one in own if one.get(side)}
        for side in ("from", "to")
    }
    reason = {"reason": f"begun {_utc(_started(begun[-1]))}"} if begun else {}
    apps = [event["app"] for event in own]
    return StepResult.from_dict({**own[0], "name": own[0].get("step"), "apps": apps, **sides, **reason})


def _started(event: Event) -> float:
    return float(event["started"])


def _utc(seconds: float) -> str:
    return time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime(seconds))
