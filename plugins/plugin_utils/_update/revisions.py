# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a Deployment of ours, and the ConfigMap beside it, say of its version. Pure."""

from __future__ import annotations

import json
from collections.abc import Collection, Iterable, Mapping
from typing import Any

from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.managed_fields import applied_part, foreign_fields
from ansible_collections.rosops.fleet.plugins.plugin_utils._model import names
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.world import Live, Object

HISTORY_KEY = "history.json"
CONTRACT_KEY = "contract.json"

Key = tuple[str, str]  # namespace, name


def read_histories(maps: Iterable[Object]) -> dict[str, list[dict[str, Any]]]:
    """App -> what its ConfigMap `<app>-update` keeps, the last one first."""
    return _read(maps, HISTORY_KEY, "[]")


def read_contracts(maps: Iterable[Object]) -> dict[str, Object]:
    """App -> what its last step asked of it (`_ros/contract.py`), with `revision`, `apps` and `proven`."""
    return _read(maps, CONTRACT_KEY, "{}")


def _read(maps: Iterable[Object], key: str, empty: str) -> dict[str, Any]:
    return {
        str(item["metadata"]["labels"][names.LABEL_APP]): json.loads((item.get("data") or {}).get(key) or empty)
        for item in maps
        if names.LABEL_APP in (item["metadata"].get("labels") or {})
    }


def working(live: Live, histories: Mapping[str, Any], contracts: Mapping[str, Object]) -> set[Key]:
    """The Deployments that were proven once, have something to go back to, or have a pod that is Ready.

    A mark alone says nothing against what works, nor does a ConfigMap that is not there.
    """
    ready = {(pod["metadata"]["namespace"], app_of(pod)) for pod in live.pods if _is_ready(pod)}
    return {
        key_of(item)
        for item in live.deployments
        if not is_updating(item)
        or histories.get(app_of(item))
        or contracts.get(app_of(item), {}).get("proven")
        or (key_of(item)[0], app_of(item)) in ready
    }


def _is_ready(pod: Object) -> bool:
    containers = (pod.get("status") or {}).get("containerStatuses") or []
    return bool(containers) and all(container.get("ready") for container in containers)


def files_owner(item: Object) -> Key:
    """The app whose files a ConfigMap holds; without a name where it is another one."""
    return key_of(item)[0], (item["metadata"].get("labels") or {}).get(names.LABEL_FILES, "")


def unused(live: Live, apps: Collection[Key], wanted: Iterable[Object]) -> list[Object]:
    """What these apps had and have no more: Services, and ConfigMaps of files that no version mounts.

    A version is one that is there, one that is kept for the way back, or the one that is wanted.
    """
    there = [entry["deployment"] for entries in read_histories(live.maps).values() for entry in entries]
    mounted = {
        (key_of(item)[0], volume["configMap"]["name"])
        for item in [*live.deployments, *there]
        for volume in item["spec"]["template"]["spec"].get("volumes") or []
        if "configMap" in volume
    }
    used = {key_of(item) for item in wanted}
    maps = [item for item in live.maps if files_owner(item) in apps and key_of(item) not in used | mounted]
    services = [item for item in live.services if key_of(item) in apps and key_of(item) not in used]
    return [identity(item) for item in [*maps, *services]]


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
    passing = (names.ANNOTATION_UPDATING, names.ANNOTATION_WENT_BACK)  # of this time, not of the next
    annotations = {key: text for key, text in annotations_of(part).items() if key not in passing}
    return {**part, "metadata": {**part["metadata"], "annotations": annotations}}


def described(deployment: Object) -> dict[str, str]:
    """What an operator wants to read of a version."""
    images = [container.get("image", "") for container in deployment["spec"]["template"]["spec"]["containers"]]
    return {"image": images[0] if images else "", "revision": revision_of(deployment)}


def revision_of(deployment: Object) -> str:
    """The first digits of the pod template's hash."""
    metadata = deployment["spec"]["template"]["metadata"]
    label = (metadata.get("labels") or {}).get(names.LABEL_REVISION)
    return str(label or (metadata.get("annotations") or {}).get(names.ANNOTATION_HASH, "")[:8])


def deployments_of(objects: Iterable[Object]) -> list[Object]:
    """The Deployments among the objects."""
    return [item for item in objects if item["kind"] == "Deployment"]


def app_of(deployment: Object) -> str:
    """The app that a Deployment of ours belongs to."""
    return str((deployment["metadata"].get("labels") or {}).get(names.LABEL_APP, ""))


def identity(item: Object) -> dict[str, Any]:
    """As much of an object as deleting it takes."""
    metadata = {key: item["metadata"][key] for key in ("name", "namespace")}
    return {"apiVersion": item["apiVersion"], "kind": item["kind"], "metadata": metadata}


def key_of(item: Object) -> Key:
    return str(item["metadata"]["namespace"]), str(item["metadata"]["name"])


def annotations_of(item: Object | None) -> Mapping[str, str]:
    return ((item or {}).get("metadata") or {}).get("annotations") or {}


def hash_of(item: Object | None) -> str:
    return annotations_of(item).get(names.ANNOTATION_HASH, "")


def is_updating(item: Object | None) -> bool:
    return names.ANNOTATION_UPDATING in annotations_of(item)


def node_of(deployment: Object) -> str:
    """The app's ROS node in the graph; empty where it has none that can be known."""
    return annotations_of(deployment["spec"]["template"]).get(names.ANNOTATION_NODE, "")


def handoff_of(deployment: Object) -> str:
    """How its versions follow each other."""
    return annotations_of(deployment["spec"]["template"]).get(names.ANNOTATION_HANDOFF, "replace")
