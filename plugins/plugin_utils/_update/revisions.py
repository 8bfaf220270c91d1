# SPDX-License-Identifier: GPL-3.0-or-later
"""What a Deployment of ours and the record beside it say of its version, and what somebody changed by hand. Pure.

`kubectl set image` and `kubectl scale` leave the annotations with our hashes as they are. The API server adds defaults
and writes quantities its own way, so what differs is a suspicion; a dry run of the apply says whether it is one. What
was put beside our fields (`kubectl set env`, a second container, a pause) is seen by who owns it.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from typing import Any

from ...module_utils._step.objects import annotations_of, app_of, hash_of, is_in, is_ready, revision_of
from ...module_utils._step.record import GOING_BACK, PROVEN, UNKNOWN, UNPROVEN, answer, soaks
from ...module_utils._step.words import BACK_TO, SOAKING, UPDATING, WENT_BACK
from .._kube.applied import applied_part, foreign_fields, left_fields
from .._model import names
from .world import Live, Object

Key = tuple[str, str]  # namespace, name
PASSING = (UPDATING, SOAKING, BACK_TO, WENT_BACK)  # what is noted on a Deployment, of this time and not of the next


def working(live: Live) -> set[Key]:
    """The Deployments that may be at work: all but those that no step has ever proven and that have no Ready pod."""
    ready = {(pod["metadata"]["namespace"], app_of(pod)) for pod in live.pods if is_ready(pod)}
    found = {key_of(item): answer(item, live.records) for item in live.deployments}
    at_work = PROVEN, GOING_BACK, UNKNOWN
    return {key for key, said in found.items() if said in at_work or live.records[key[1]].history or key in ready}


def files_owner(item: Object) -> Key:
    """The app whose files a ConfigMap holds; without a name where it is another one."""
    return key_of(item)[0], (item["metadata"].get("labels") or {}).get(names.LABEL_FILES, "")


def unused(live: Live, apps: Collection[Key], wanted: Iterable[Object]) -> list[Object]:
    """What these apps had and have no more: Services, and ConfigMaps of files that no version mounts.

    A version is one that is there, one that is kept for the way back, or the one that is wanted.
    """
    there = [entry["deployment"] for record in live.records.values() for entry in record.history]
    mounted = {
        (key_of(item)[0], volume["configMap"]["name"])
        for item in [*live.deployments, *there]
        for volume in item["spec"]["template"]["spec"].get("volumes") or []
        if "configMap" in volume
    }
    used = {key_of(item) for item in wanted if "namespace" in item["metadata"]}
    maps = [item for item in live.maps if files_owner(item) in apps and key_of(item) not in used | mounted]
    services = [item for item in live.services if key_of(item) in apps and key_of(item) not in used]
    return [identity(item) for item in [*maps, *services]]


def claim_users(live: Live, claims: Collection[Object], leaving: Collection[str] = ()) -> list[str]:
    """`claim app`, for each of the claims that a Deployment mounts; the apps that are `leaving` do not count."""
    wanted = {key_of(claim) for claim in claims}
    return [
        f"{name} {app_of(item)}"
        for item in live.deployments
        if app_of(item) not in leaving
        for volume in item["spec"]["template"]["spec"].get("volumes") or []
        if (name := (volume.get("persistentVolumeClaim") or {}).get("claimName"))
        and (item["metadata"]["namespace"], name) in wanted
    ]


def kept(deployment: Object, whole: bool = False) -> dict[str, Any]:
    """A live Deployment in the form in which it can be applied again; `whole` with what others changed of it.

    What others set and set back, as `kubectl set image` and `kubectl rollout undo` do, is theirs, though it is what we
    applied: our part of it lacks the image then, and could not be applied.
    """
    part = None if whole else applied_part(deployment, names.MANAGER)
    if part is None or foreign_fields(deployment, part, names.MANAGER):
        # somebody else applied it: without what the API server keeps for itself it is what it was
        own = {"name", "namespace", "labels", "annotations"}
        metadata = {key: value for key, value in deployment["metadata"].items() if key in own}
        spec = {key: value for key, value in deployment["spec"].items() if key != "paused"}  # nothing would go back
        part = {"apiVersion": "apps/v1", "kind": "Deployment", "metadata": metadata, "spec": spec}
    annotations = {key: text for key, text in annotations_of(part).items() if key not in PASSING}
    return {**part, "metadata": {**part["metadata"], "annotations": annotations}}


def described(deployment: Object) -> dict[str, str]:
    """What an operator wants to read of a version."""
    images = [container.get("image", "") for container in deployment["spec"]["template"]["spec"]["containers"]]
    return {"image": images[0] if images else "", "revision": revision_of(deployment)}


def deployments_of(objects: Iterable[Object]) -> list[Object]:
    return [item for item in objects if item["kind"] == "Deployment"]


def identity(item: Object) -> dict[str, Any]:
    """As much of an object as deleting it takes, and nothing else that has its name by then."""
    metadata = {key: item["metadata"][key] for key in ("name", "namespace", "uid") if key in item["metadata"]}
    return {"apiVersion": item["apiVersion"], "kind": item["kind"], "metadata": metadata}


def key_of(item: Object) -> Key:
    return str(item["metadata"]["namespace"]), str(item["metadata"]["name"])


# --- what somebody changed by hand ----------------------------------------------------------------------------------


def suspects(wanted: Iterable[Object], live: Live) -> list[Object]:
    """Of the Deployments that are wanted those that are there by their hash, but not by what they say.

    What a step has noted on them stays there: to take it off is no change by hand.
    """
    there, records = {key_of(item): item for item in live.deployments}, live.records
    return [
        _with_notes(item, found)
        for item in wanted
        if (found := there.get(key_of(item))) is not None
        and hash_of(found) == hash_of(item)
        and (answer(found, records) not in UNPROVEN or soaks(found, records))  # a step applies the others again anyway
        and _is_changed(item, found)
    ]


def _with_notes(item: Object, there: Object) -> Object:
    notes = {key: text for key, text in annotations_of(there).items() if key in PASSING}
    return {**item, "metadata": {**item["metadata"], "annotations": {**annotations_of(item), **notes}}}


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
