# SPDX-License-Identifier: GPL-3.0-or-later
"""What a step leaves in a cluster when its run has gone, as the API shows it."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import KubeError
from ansible_collections.rosops.fleet.plugins.module_utils._robot.way_back import Member, member_of
from ansible_collections.rosops.fleet.plugins.module_utils._step.record import record_of

NAMESPACE = "robot-r1"
UPDATING, WENT_BACK = "rosops.fleet/updating", "rosops.fleet/went-back"


def version(app: str, number: int, namespace: str = NAMESPACE, node: str | None = None) -> dict[str, Any]:
    """A Deployment as it is applied."""
    notes = {} if node == "" else {"rosops.fleet/ros-node": node or f"/{app}_{number}"}
    template = {
        "metadata": {"labels": {"rosops.fleet/revision": f"rev{number}"}, "annotations": notes},
        "spec": {"containers": [{"name": "ros-app", "image": f"x/{app}:{number}"}]},
    }
    return {
        "apiVersion": "apps/v1",
        "kind": "Deployment",
        "metadata": {
            "name": app,
            "namespace": namespace,
            "labels": {"rosops.fleet/app": app, "app.kubernetes.io/managed-by": "rosops.fleet"},
            "annotations": {"rosops.fleet/spec-hash": f"hash of {app} {number}"},
        },
        "spec": {"replicas": 1, "template": template},
    }


def live(
    deployment: dict[str, Any], *, marked: bool = True, ready: bool = False, generation: int = 2
) -> dict[str, Any]:
    """The same as the API shows it."""
    metadata = deployment["metadata"]
    notes = {**metadata["annotations"], **({UPDATING: "1000"} if marked else {})}
    counts = {"replicas": 1, "updatedReplicas": 1, "readyReplicas": int(ready)}
    return {
        **deployment,
        "metadata": {**metadata, "annotations": notes, "generation": generation},
        "status": {"observedGeneration": generation, **counts},
    }


def left(*before: dict[str, Any], **contract: Any) -> dict[str, Any]:
    """The ConfigMap of an app: earlier versions, the last one first, and the contract."""
    history = [
        {"revision": one["spec"]["template"]["metadata"]["labels"]["rosops.fleet/revision"], "deployment": one}
        for one in before
    ]
    said = {"revision": "rev2", **contract}
    return {"data": {"history.json": json.dumps(history), "contract.json": json.dumps(said)}}


def member(deployment: dict[str, Any], beside: Any, pods: Any = (), **others: Any) -> Member:
    """The keeper's view of a Deployment and the ConfigMap beside it; `others` are those of the step's other apps."""
    maps = {deployment["metadata"]["name"]: beside, **others}
    return member_of(deployment, {app: record_of(item) for app, item in maps.items()}, pods)


def pod(
    app: str, number: int, address: str = "10.42.0.9", *, crashes: bool = False, ended: dict[str, Any] | None = None
) -> dict[str, Any]:
    """A pod of a version; `crashes`: it is waited before its container is started once more; `ended`: how it did."""
    state = {"waiting": {"reason": "CrashLoopBackOff"}} if crashes else {"running": {}}
    last = {"terminated": ended} if ended else {}
    return {
        "metadata": {"labels": {"rosops.fleet/app": app, "rosops.fleet/revision": f"rev{number}"}},
        "spec": {},
        "status": {"podIP": address, "containerStatuses": [{"name": "ros-app", "state": state, "lastState": last}]},
    }


class Api:
    """A keeper's cluster as far as all that watch it read it, and its files. A test takes it away."""

    def __init__(self, *spaces: str) -> None:
        self.spaces, self.home = [*spaces], spaces[0]
        self.leases_now: dict[str, dict[str, Any]] = {}
        self.there: dict[tuple[str, str], dict[str, Any]] = {}  # Deployments, by namespace and name,
        self.maps: dict[tuple[str, str], dict[str, Any]] = {}  # and ConfigMaps, an app's record by the app's name
        self.number, self.away = 10, False
        self.requests: list[str] = []
        self.done: list[str] = []
        self.files: dict[str, Any] = {}

    def _ask(self, what: str) -> None:
        self.requests.append(what)
        if self.away:
            raise KubeError("nothing listens")

    def before(self, request: str, happens: Callable[..., Any], once: bool = False) -> None:
        """Let something happen right before whatever is asked for in this way."""
        real = getattr(self, request)

        def asked(*given: Any) -> Any:
            if once:
                setattr(self, request, real)
            happens(*given)
            return real(*given)

        setattr(self, request, asked)

    def stamp(self) -> str:
        return "1970-01-01T00:00:00.000000Z"

    def namespaces(self) -> list[str]:
        return self.spaces

    def leases(self) -> dict[str, dict[str, Any] | None]:
        self._ask("leases")
        return {name: self.leases_now.get(name) for name in self.spaces}

    def lease(self, namespace: str, newest: bool = False) -> dict[str, Any] | None:  # noqa: ARG002 - all is new here
        self._ask("lease")
        return self.leases_now.get(namespace)

    def write_lease(self, namespace: str, body: dict[str, Any]) -> dict[str, Any] | None:
        self._ask("write lease")
        there = self.leases_now.get(namespace, {"metadata": {}})
        if there["metadata"].get("resourceVersion") != body["metadata"].get("resourceVersion"):
            return None
        self.number += 1
        made = {**body, "metadata": {**body["metadata"], "resourceVersion": str(self.number)}}
        self.leases_now[namespace] = made
        self.done.append(f"lease {body['spec']['holderIdentity'] or 'free'}")
        return made

    def deployments(self, namespace: str) -> list[dict[str, Any]]:
        self._ask("deployments")
        return [item for (space, _name), item in self.there.items() if space == namespace]

    def deployment(self, namespace: str, name: str) -> dict[str, Any] | None:
        self._ask("deployment")
        return self.there.get((namespace, name))

    def config_map(self, namespace: str, name: str) -> dict[str, Any] | None:
        self._ask(name if name == "robot-updates" else "map")
        return self.maps.get((namespace, name.removesuffix("-update")))

    def load(self, part: str) -> Any:
        return self.files.get(part)

    def save(self, part: str, content: Any) -> bool:
        self.files[part] = json.loads(json.dumps(content))
        return True


def lease(holder: str, number: int = 1, seconds: int = 15) -> dict[str, Any]:
    spec = {"holderIdentity": holder, "leaseDurationSeconds": seconds, "leaseTransitions": 3, "acquireTime": "before"}
    return {"metadata": {"name": "robot-update", "resourceVersion": str(number)}, "spec": spec}
