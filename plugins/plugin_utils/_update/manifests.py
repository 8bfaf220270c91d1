# SPDX-License-Identifier: GPL-3.0-or-later
"""What a step applies: the records first, then the new versions with the mark of their step. Pure.

Where two versions cannot work at once (`drain`, `replace`) the app is away for as long as the change takes. What needs
no such change, a pod with its place, its volumes and its image, is made `beside` the old version before anything is
held: so the app is away for less long, and not at all for a version that cannot even be started. The pod waits by
itself for the old one's end (`_pod/namesake.py`).

A launch file of which only some nodes wait for the old ones' end (`launch.replace`) gets Ready with the others. So that
the old pod does not go by that alone, while goals of its action servers are not held yet, the Deployment asks for more
seconds of being Ready than a step lasts.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from ...module_utils._ros.contract import NOTHING, Contract
from ...module_utils._step.objects import annotations_of, app_of, ends_of, labels_of, revision_of, revision_of_pod
from ...module_utils._step.record import Mark, Record, record_of
from ...module_utils._step.update_record import run_of
from ...module_utils._step.words import TEMPLATE_HASH, UPDATING
from .._model import names
from .._objects.admission import back_to
from .._objects.app import OVERLAP_STRATEGY
from .._objects.common import config_map, object_labels
from .._objects.pod_code import waits_for_the_old
from .plan import APP, INSTALL, Step
from .revisions import described
from .world import Calm, Object

HISTORY_KEPT = 5


def step_objects(
    step: Step, contracts: Mapping[str, Contract], tolerance: float, ready_timeout: float, now: float
) -> list[Object]:
    """The contracts and the way back first, then the new versions with the mark of what is not proven yet.

    `tolerance` is the share by which rates may fall below the recorded ones, `ready_timeout` the seconds that a version
    has to get ready, `now` when the step began, in seconds since 1970.
    """
    maps = []
    for item in step.workloads:
        app, metadata = app_of(item), item["metadata"]
        contract, apps = contracts.get(app, NOTHING), tuple(step.apps)
        if step.kind == INSTALL:  # each app by itself, and what is only just to come
            contract, apps = Contract(install=True), (app,)
        # a contract that is taken over from an earlier step says nothing of this one; and no clock ends it: it counts
        # for its revision until it says `proven`
        owed = replace(contract, revision=revision_of(item), tolerance=tolerance)
        history, run, ignore = _history(app, step, now), run_of(now), step.intended.ignore
        record = Record(owed, history, run, apps, ready_timeout=ready_timeout, ignore=ignore)
        labels = object_labels(app, metadata["labels"].get(names.LABEL_ROBOT))
        maps.append(config_map(names.update_name(app), metadata["namespace"], labels, record.data()))
    return [*maps, *marked(step.objects, maps, run_of(now))]


def _history(app: str, step: Step, now: float) -> list[Object]:
    """Earlier versions, the last proven one first, each once."""
    before = step.previous.get(app)
    if before is None:
        return list(step.histories.get(app, []))
    first = {"revision": revision_of(before), **described(before), "replaced": int(now), "deployment": before}
    rest = [entry for entry in step.histories.get(app, []) if entry["revision"] != first["revision"]]
    return [first, *rest][:HISTORY_KEPT]


def fulfilled(maps: Iterable[Object]) -> list[Object]:
    """The records of a step, once its contracts are fulfilled. Only then may the mark come off."""
    return [{**item, "data": record_of(item).fulfilled().data()} for item in maps]


def found_good(maps: Iterable[Object], soak: float, pods: Sequence[Object]) -> list[Object]:
    """The records of a step that its run has found good; `pods` are those of the new version."""
    hashes = {revision_of_pod(pod): labels_of(pod).get(TEMPLATE_HASH) for pod in pods}
    templates = {revision: found for revision, found in hashes.items() if found}

    def good(item: Object) -> Object:
        ends = ends_of(pod for pod in pods if app_of(pod) == app_of(item))
        return {**item, "data": record_of(item).found_good(soak, ends, templates).data()}

    return [good(item) for item in maps]


def marked(objects: Iterable[Object], maps: Iterable[Object], run: str, key: str = UPDATING) -> list[Object]:
    """The objects with the mark of an unproven version on the Deployments; SOAKING: of one that was found good.

    `maps` are the records of the step: of which version each may go back to without a run.
    """
    before = {app_of(item): record_of(item).before for item in maps}

    def with_mark(item: Object) -> Object:
        mark = {key: str(Mark(run, revision_of(item))), **back_to(before.get(app_of(item)))}
        return {**item, "metadata": {**item["metadata"], "annotations": {**annotations_of(item), **mark}}}

    return [with_mark(item) if item["kind"] == "Deployment" else item for item in objects]


# --- beside the old version -----------------------------------------------------------------------------------------


def early(step: Step, calm: Calm, kept: bool = True) -> list[Object]:
    """The Deployments that can start beside; none of a step that was cut off, or of which somebody changed one.

    What is `calm` are the actions whose goals the step holds: without any a launch file has nothing to wait for. Nor
    has it where the robot's master is not `kept`: should the run die, Kubernetes would hand over in its own time, and
    nobody would hold the goals.
    """
    if step.kind != APP or step.unproven or step.drifted:
        return []
    goals_held = kept and bool(calm.actions)
    chosen = []
    for item in step.workloads:
        app = app_of(item)
        node, launch = step.new_nodes.get(app), step.launched.get(app)
        if waits_for_the_old(item):
            starts = bool(node) and node == step.old_nodes.get(app)  # by the name it finds the old one
        else:
            starts = goals_held and launch is not None and bool(launch.new and launch.held)
        chosen += [item] if starts and app in step.previous else []
    return chosen


def beside(objects: Sequence[Object], chosen: Iterable[Object]) -> list[Object]:
    """Of a step's objects the ConfigMaps, and these Deployments, the old pods of which stay for now."""
    apps = {app_of(item) for item in chosen}
    deployments = [item for item in objects if item["kind"] == "Deployment" and app_of(item) in apps]
    return [*(item for item in objects if item["kind"] == "ConfigMap"), *map(_beside, deployments)]


def _beside(deployment: Object) -> Object:
    spec = {**deployment["spec"], "strategy": dict(OVERLAP_STRATEGY)}
    if not waits_for_the_old(deployment):
        # not available for as long as the API allows; once it is applied without, its pod is available at once
        spec["minReadySeconds"] = spec.get("progressDeadlineSeconds", 600) - 1
    return {**deployment, "spec": spec}
