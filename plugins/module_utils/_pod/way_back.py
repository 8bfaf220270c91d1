# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""When a robot goes back without a control node, and to what. Pure: time is told to it, and what the API shows.

A step of an update marks its Deployments, and leaves beside each (ConfigMap `<app>-update`) a contract and the version
before. Whoever takes the step renews the robot's Lease. When nobody does any more, a version that is Ready has
fulfilled its contract by its own probe: it stays, marked, for the next run. One that does not get ready is taken back,
with all apps of its step.

No clock is compared with another one's, and time counts only while the API shows what happens: after a while without
it the waiting goes on where it was.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any, Iterable, Mapping, Sequence

LEASE = "robot-update"
HOLDER = "ros-keeper"  # the keeper's own Deployment, too: it takes back everything but itself
LEASE_SECONDS = 15.0
READY_TIMEOUT = 180.0  # where the contract does not say it
UPDATING = "rosops.fleet/updating"
WENT_BACK = "rosops.fleet/went-back"
NODE = "rosops.fleet/ros-node"
HASH = "rosops.fleet/spec-hash"

Object = Mapping[str, Any]


# ---- what the API shows


def name_of(item: Object) -> str:
    return str(item["metadata"]["name"])


def notes_of(item: Object) -> Mapping[str, str]:
    return item["metadata"].get("annotations") or {}


def node_of(deployment: Object) -> str:
    """The ROS node of a Deployment's pods; empty where it has none that is known, as the master has."""
    return str((deployment["spec"]["template"]["metadata"].get("annotations") or {}).get(NODE, ""))


def is_marked(deployment: Object) -> bool:
    return UPDATING in notes_of(deployment)


def rolled_out(deployment: Object) -> bool:
    """Whether the controller has seen this very Deployment, and all pods are of its template, and Ready."""
    status, wanted = deployment.get("status") or {}, deployment["spec"].get("replicas", 1)
    seen = int(status.get("observedGeneration") or 0) >= int(deployment["metadata"].get("generation") or 0)
    counts = {status.get(key) or 0 for key in ("replicas", "updatedReplicas", "readyReplicas")}
    return seen and counts == {wanted}


@dataclass(frozen=True)
class Unproven:
    """A Deployment with the mark, and what its step left beside it."""

    deployment: Object
    contract: Mapping[str, Any]
    before: Object | None  # the Deployment to go back to; None: the step made it

    @property
    def name(self) -> str:
        return name_of(self.deployment)

    @property
    def apps(self) -> tuple[str, ...]:
        """The apps of its step, in the step's order."""
        return tuple(self.contract.get("apps") or (self.name,))

    @property
    def ready_timeout(self) -> float:
        return float(self.contract.get("ready_timeout") or READY_TIMEOUT)

    @property
    def failing(self) -> bool:
        """Whether going back would change something for the better."""
        if self.before is None or self.contract.get("proven") or rolled_out(self.deployment):
            return False
        return notes_of(self.before).get(HASH) != notes_of(self.deployment).get(HASH)


def unproven(deployment: Object, left: Object | None) -> Unproven:
    """`left` is the ConfigMap of its step. What cannot be read there is not there."""
    data = (left or {}).get("data") or {}
    contract, history = _json(data.get("contract.json")), _json(data.get("history.json"))
    first = history[0] if isinstance(history, list) and history else {}
    before = first.get("deployment") if isinstance(first, dict) else None
    same = isinstance(before, dict) and (before.get("metadata") or {}).get("name") == name_of(deployment)
    return Unproven(deployment, contract if isinstance(contract, dict) else {}, before if same else None)


def _json(text: Any) -> Any:
    try:
        return json.loads(text or "null")
    except (TypeError, ValueError):
        return None


@dataclass(frozen=True)
class Step:
    """The marked Deployments that one step changed together. `begun`: others of them are back already."""

    members: tuple[Unproven, ...]
    begun: bool = False

    @property
    def name(self) -> str:
        return ", ".join(member.name for member in self.members)

    @property
    def key(self) -> tuple[tuple[str, int], ...]:
        """Other for every other version: its time begins anew."""
        return tuple((one.name, int(one.deployment["metadata"].get("generation") or 0)) for one in self.members)

    @property
    def ready_timeout(self) -> float:
        return max(member.ready_timeout for member in self.members)

    @property
    def failing(self) -> bool:
        return bool(self.going_back) and (self.begun or any(member.failing for member in self.members))

    @property
    def going_back(self) -> list[Unproven]:
        """All of it together, but what the step made: there is nothing that it could go back to."""
        return [member for member in self.members if member.before is not None]


def steps_of(found: Iterable[Unproven], deployments: Iterable[Object]) -> list[Step]:
    """The steps that the marked ones belong to; `deployments` are all there are."""
    back = {name_of(item) for item in deployments if WENT_BACK in notes_of(item) and not is_marked(item)}
    groups: dict[tuple[str, ...], list[Unproven]] = {}
    for member in found:
        if member.name != HOLDER:
            groups.setdefault(member.apps, []).append(member)
    return [
        Step(tuple(sorted(members, key=lambda one: place(one, apps))), bool(back.intersection(apps)))
        for apps, members in groups.items()
    ]


def place(member: Unproven, apps: Sequence[str]) -> int:
    """Providers come before their users, as the step had them."""
    return apps.index(member.name) if member.name in apps else len(apps)


# ---- since when


class Observed:
    """What was seen of one namespace, and for how long: its Lease, and the steps that are failing."""

    def __init__(self) -> None:
        self.version = ""  # the Lease's
        self.free = False
        self.nothing: Any = None  # the Leases' versions at which nothing was marked
        self.waited: dict[Any, float] = {}
        self._unchanged = self._passed = 0.0
        self._last: float | None = None

    def away(self) -> None:
        """The API did not answer: what happens until the next look does not count."""
        self._last = None

    def lease(self, lease: Object | None, now: float) -> None:
        """A look begins: whether somebody takes steps here. It is free where it has no holder, or stood still."""
        self._passed = 0.0 if self._last is None else now - self._last
        self._last = now
        spec = (lease or {}).get("spec") or {}
        version = version_of(lease)
        self._unchanged = self._unchanged + self._passed if version == self.version else 0.0
        self.version = version
        mine = holder_of(lease) in ("", HOLDER)
        self.free = mine or self._unchanged >= float(spec.get("leaseDurationSeconds") or LEASE_SECONDS)
        if not self.free:
            self.waited = {}

    def due(self, steps: Iterable[Step]) -> list[Step]:
        """The steps whose time is over, of all that there are."""
        failing = [step for step in steps if step.failing]
        known = self.waited
        self.waited = {one.key: known[one.key] + self._passed if one.key in known else 0.0 for one in failing}
        return [step for step in failing if step.begun or self.waited[step.key] >= step.ready_timeout]


# ---- what is written


def version_of(lease: Object | None) -> str:
    return str(((lease or {}).get("metadata") or {}).get("resourceVersion") or "")


def holder_of(lease: Object | None) -> str:
    return str(((lease or {}).get("spec") or {}).get("holderIdentity") or "")


def lease_of(found: Object | None, namespace: str, holder: str, time: str) -> dict[str, Any]:
    """The Lease with this holder, or with none; the API refuses it if somebody else has written it since `found`."""
    spec = (found or {}).get("spec") or {}
    ours = holder_of(found) == HOLDER
    return {
        "apiVersion": "coordination.k8s.io/v1",
        "kind": "Lease",
        "metadata": (found or {}).get("metadata") or {"name": LEASE, "namespace": namespace},
        "spec": {
            **spec,
            "holderIdentity": holder,
            "leaseDurationSeconds": int(LEASE_SECONDS),
            "renewTime": time,
            "acquireTime": spec.get("acquireTime", time) if ours else time,
            "leaseTransitions": int(spec.get("leaseTransitions") or 0) + (bool(spec) and not ours),
        },
    }


def restored(member: Unproven, reason: str, time: str) -> dict[str, Any]:
    """What to apply: the version before as it was applied, without the mark, and how it came back."""
    before = member.before or {}
    notes = {key: value for key, value in notes_of(before).items() if key != UPDATING}
    told = {"from": revision_of(member.deployment), "to": revision_of(before), "at": time, "reason": reason}
    notes[WENT_BACK] = json.dumps(told, sort_keys=True)
    return {**before, "metadata": {**before["metadata"], "annotations": notes}}


def revision_of(deployment: Object) -> str:
    """The first digits of the pod template's hash."""
    metadata = deployment["spec"]["template"]["metadata"]
    label = (metadata.get("labels") or {}).get("rosops.fleet/revision")
    return str(label or (metadata.get("annotations") or {}).get(HASH, "")[:8])
