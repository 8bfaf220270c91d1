# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a step applies: the records first, then the new versions with the mark of their step. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from ...module_utils._ros.contract import NOTHING, Contract
from ...module_utils._step.objects import annotations_of, app_of, ends_of, revision_of
from ...module_utils._step.record import Mark, Record, record_of
from ...module_utils._step.update_record import run_of
from ...module_utils._step.words import UPDATING
from .._model import names
from .._objects.common import RECREATE_STRATEGY, object_labels
from .plan import Step
from .revisions import described
from .world import Object

HISTORY_KEPT = 5
INSTALL = Contract(install=True)  # of what is only just to come


@dataclass(frozen=True)
class Bounds:
    """How far rates may fall below the recorded ones, as a share, and the seconds that a version has to get ready."""

    tolerance: float
    ready_timeout: float


def step_objects(step: Step, contracts: Mapping[str, Contract], bounds: Bounds, now: float) -> list[Object]:
    """The contracts and the way back first, then the new versions with the mark of what is not proven yet."""
    maps = [_update_map(item, step, contracts.get(app_of(item), NOTHING), bounds, now) for item in step.workloads]
    # the node's name is taken by what runs: for the time of the step the old one goes first
    objects = with_strategy(step.objects, RECREATE_STRATEGY) if step.drifted else step.objects
    return [*maps, *marked(objects, run_of(now))]


def with_strategy(objects: Iterable[Object], strategy: Object) -> list[Object]:
    """These objects, with their Deployments' pods replaced in this way."""
    return [
        {**item, "spec": {**item["spec"], "strategy": dict(strategy)}} if item["kind"] == "Deployment" else item
        for item in objects
    ]


def installing(objects: Sequence[Object], step: Step, bounds: Bounds, now: float) -> list[Object]:
    """The records of an installation first, each app's by itself, then what it brings, marked."""
    each = [(item, replace(step, apps=[app_of(item)])) for item in step.workloads]
    maps = [_update_map(item, one, INSTALL, bounds, now) for item, one in each]
    return [*maps, *marked(objects, run_of(now))]


def installed(workloads: Iterable[Object], step: Step, bounds: Bounds, now: float) -> list[Object]:
    """That these of its Deployments were proven, each by itself; their graph is recorded before their next step."""
    each = [(item, replace(step, apps=[app_of(item)])) for item in workloads]
    return fulfilled([_update_map(item, one, INSTALL, bounds, now) for item, one in each])


def fulfilled(maps: Iterable[Object]) -> list[Object]:
    """The records of a step, once its contracts are fulfilled. Only then may the mark come off."""
    return [{**item, "data": record_of(item).fulfilled().data()} for item in maps]


def found_good(maps: Iterable[Object], soak: float, pods: Iterable[Object]) -> list[Object]:
    """The records of a step that its run has found good; `pods` are those of the new version."""
    own: dict[str, list[Object]] = {}
    for pod in pods:
        own.setdefault(app_of(pod), []).append(pod)
    return [
        {**item, "data": record_of(item).found_good(soak, ends_of(own.get(app_of(item), ()))).data()} for item in maps
    ]


def _update_map(deployment: Object, step: Step, contract: Contract, bounds: Bounds, now: float) -> Object:
    """No clock ends a contract: it counts for its revision until it says `proven`."""
    app, metadata = app_of(deployment), deployment["metadata"]
    # one that is taken over from an earlier step says nothing of this one
    owed = replace(contract, revision=revision_of(deployment), tolerance=bounds.tolerance)
    record = Record(owed, _history(app, step, now), run_of(now), tuple(step.apps), ready_timeout=bounds.ready_timeout)
    labels = object_labels(app, metadata["labels"].get(names.LABEL_ROBOT))
    return {
        "apiVersion": "v1",
        "kind": "ConfigMap",
        "metadata": {"name": names.update_name(app), "namespace": metadata["namespace"], "labels": labels},
        "data": record.data(),
    }


def _history(app: str, step: Step, now: float) -> list[Object]:
    """Earlier versions, the last proven one first, each once."""
    before = step.previous.get(app)
    if before is None:
        return list(step.histories.get(app, []))
    first = {"revision": revision_of(before), **described(before), "replaced": int(now), "deployment": before}
    rest = [entry for entry in step.histories.get(app, []) if entry["revision"] != first["revision"]]
    return [first, *rest][:HISTORY_KEPT]


def marked(objects: Iterable[Object], run: str, key: str = UPDATING) -> list[Object]:
    """The objects with the mark of an unproven version on the Deployments; SOAKING: of one that was found good."""
    found: list[Object] = []
    for item in objects:
        if item["kind"] == "Deployment":
            mark = {key: str(Mark(run, revision_of(item)))}
            found.append({**item, "metadata": {**item["metadata"], "annotations": {**annotations_of(item), **mark}}})
        else:
            found.append(item)
    return found
