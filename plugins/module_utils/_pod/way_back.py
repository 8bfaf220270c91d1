# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""When a robot goes back without a control node, and to what. Pure: time is told to it, and what the API shows.

A step of an update marks its Deployments, and leaves beside each (ConfigMap `<app>-update`) a contract and the version
before. Whoever takes the step renews the robot's Lease. When nobody does any more, a version that is Ready has
fulfilled its contract by its own probe: it stays, marked, for the next run. One that does not get ready is taken back,
with all apps of its step; at once if its container ended with an error, as a run does.

A version that was Ready once and is not any more stays: that alone does not show that the version is bad, as its host
may be away or have been rebooted. Only a version whose container ends again and again is taken back all the same.

No clock is compared with another one's, and time counts only while the API shows what happens: after a while without
it the waiting goes on where it was.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any, Iterable, Iterator, Mapping, Sequence

from .._ros.graph import host_of
from .subset import is_in

LEASE = "robot-update"
HOLDER = "ros-keeper"  # the keeper's own Deployment, too: it takes back everything but itself
MASTER = "ros-master"
LEASE_SECONDS = 15.0
READY_TIMEOUT = 180.0  # where the contract does not say it
FORGIVEN = 600.0  # after so long without a crash the kubelet, too, counts a container's crashes anew
STOPPED = (0, 137, 143)  # exit codes of who was done, or was told to end by somebody else
LOST = "Unknown"  # the kubelet's reason for a container that is not there any more: its host was rebooted
UPDATING = "rosops.fleet/updating"
WENT_BACK = "rosops.fleet/went-back"
NODE, HANDOFF = "rosops.fleet/ros-node", "rosops.fleet/handoff"
APP, REVISION = "rosops.fleet/app", "rosops.fleet/revision"
HASH = "rosops.fleet/spec-hash"

Object = Mapping[str, Any]


# ---- what the API shows


def name_of(item: Object) -> str:
    return str(item["metadata"]["name"])


def notes_of(item: Object) -> Mapping[str, str]:
    return item["metadata"].get("annotations") or {}


def has_node(pod: Object, node: str, uri: str) -> bool:
    """Whether a node is in a pod: by its address, or where that is its host's, and so everybody's there, by the name
    that the pod is known by."""
    if (pod.get("spec") or {}).get("hostNetwork"):
        return notes_of(pod).get(NODE) == node
    return bool(host_of(uri)) and (pod.get("status") or {}).get("podIP") == host_of(uri)


def node_of(deployment: Object) -> str:
    """The ROS node of a Deployment's pods; empty where it has none that is known, as the master has."""
    return str((deployment["spec"]["template"]["metadata"].get("annotations") or {}).get(NODE, ""))


def suffix_of(deployment: Object) -> str:
    """What is behind the names of its nodes, where versions overlap."""
    notes = deployment["spec"]["template"]["metadata"].get("annotations") or {}
    return f"_{revision_of(deployment)}" if notes.get(HANDOFF) == "overlap" else ""


def is_marked(deployment: Object) -> bool:
    return UPDATING in notes_of(deployment)


def rolled_out(deployment: Object) -> bool:
    """Whether the controller has seen this very Deployment, and all pods are of its template, and Ready."""
    status, wanted = deployment.get("status") or {}, deployment["spec"].get("replicas", 1)
    seen = int(status.get("observedGeneration") or 0) >= int(deployment["metadata"].get("generation") or 0)
    counts = {status.get(key) or 0 for key in ("replicas", "updatedReplicas", "readyReplicas")}
    return seen and counts == {wanted}


def crashes(pod: Object) -> bool:
    """Whether the kubelet waits before it starts a container of the pod once more, because it ended again and again."""
    return any((state.get("waiting") or {}).get("reason") == "CrashLoopBackOff" for state in _states(pod))


def error_of(pod: Object) -> str:
    """The exit code of a container of the pod that ended by an error of its own; empty: none did."""
    ends = [state["terminated"] for state in _states(pod) if state.get("terminated")]
    codes = [end.get("exitCode", 0) for end in ends if LOST not in str(end.get("reason"))]
    return next((str(code) for code in codes if code not in STOPPED), "")


def _states(pod: Object) -> Iterator[Object]:
    """Of its containers now, and before they were started anew."""
    for one in (pod.get("status") or {}).get("containerStatuses") or []:
        for key in ("state", "lastState"):
            yield one.get(key) or {}


@dataclass(frozen=True)
class Unproven:
    """A Deployment with the mark, what its step left beside it, and its pods: of just this version, and of others."""

    deployment: Object
    contract: Mapping[str, Any]
    before: Object | None  # the Deployment to go back to; None: the step made it
    pods: Sequence[Object] = ()
    others: Sequence[Object] = ()

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
    def actions(self) -> frozenset[str]:
        """Those of its own node, and those of the others that a launch file starts."""
        parts = self.contract, self.contract.get("others") or {}
        return frozenset(name for part in parts for name in part.get("actions") or ())

    @property
    def nodes_before(self) -> set[str]:
        """Those of the version to go back to; of a launch file's the contract tells what it calls them."""
        if self.before is None:
            return set()
        if node_of(self.before):
            return {node_of(self.before)}
        new, old = suffix_of(self.deployment), suffix_of(self.before)
        parts = self.contract, self.contract.get("others") or {}
        named = [str(node) for part in parts for node in part.get("nodes") or ()]
        return {(node[: -len(new)] if new and node.endswith(new) else node) + old for node in named}

    @property
    def proven(self) -> bool:
        """Only its mark has to come off."""
        return bool(self.contract.get("proven")) and self.contract.get("revision") == revision_of(self.deployment)

    @property
    def differs(self) -> bool:
        """Whether going back would change something. What somebody changed by hand still has our hash."""
        if self.before is None:
            return False
        same = notes_of(self.before).get(HASH) == notes_of(self.deployment).get(HASH)
        return not (same and is_in(self.before["spec"], self.deployment["spec"]))


def unproven(deployment: Object, left: Object | None, pods: Iterable[Object] = ()) -> Unproven:
    """`left` is the ConfigMap of its step, `pods` are its namespace's. What cannot be read there is not there."""
    data = (left or {}).get("data") or {}
    contract, history = _json(data.get("contract.json")), _json(data.get("history.json"))
    first = history[0] if isinstance(history, list) and history else {}
    before = first.get("deployment") if isinstance(first, dict) else None
    same = isinstance(before, dict) and (before.get("metadata") or {}).get("name") == name_of(deployment)
    of_app = [pod for pod in pods if (pod["metadata"].get("labels") or {}).get(APP) == name_of(deployment)]
    own = [pod for pod in of_app if _revision(pod["metadata"]) == revision_of(deployment)]
    others = [pod for pod in of_app if pod not in own]
    return Unproven(deployment, contract if isinstance(contract, dict) else {}, before if same else None, own, others)


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
    def key(self) -> str:
        """Other for every other version: its time begins anew."""
        found = [one.deployment["metadata"] for one in self.members]
        return " ".join(f"{one['name']}/{one.get('uid', '')}/{one.get('generation', 0)}" for one in found)

    @property
    def ready_timeout(self) -> float:
        return max(member.ready_timeout for member in self.members)

    @property
    def rolled_out(self) -> bool:
        return all(rolled_out(member.deployment) for member in self.members)

    def failing(self, came_up: bool) -> bool:
        """Whether it is to go back. A step proves all its apps at once, and then says so of one after the other."""
        if not self.going_back or any(member.proven for member in self.members):
            return False
        return self.begun or any(member.differs and _is_bad(member, came_up) for member in self.members)

    @property
    def error(self) -> str:
        """Of a version that has not come up."""
        pods = [pod for one in self.members if not rolled_out(one.deployment) for pod in one.pods]
        return next(filter(None, map(error_of, pods)), "")

    @property
    def going_back(self) -> list[Unproven]:
        """All of it together, but what the step made: there is nothing that it could go back to."""
        return [member for member in self.members if member.before is not None]


def _is_bad(member: Unproven, came_up: bool) -> bool:
    return any(map(crashes, member.pods)) if came_up else not rolled_out(member.deployment)


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

    def __init__(self, came_up: Iterable[str] = ()) -> None:
        """`came_up` are the keys of steps that an earlier keeper saw rolled out."""
        self.version = ""  # the Lease's
        self.free = False
        self.nothing: str | None = None  # the Lease's version at which nothing was marked,
        self.recorded: str | None = None  # and for which the record of updates says what became of the steps
        self.came_up = frozenset(came_up)
        self.waited: dict[str, float] = {}  # step -> how long it was failing,
        self.rested: dict[str, float] = {}  # and since then was not
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
            self.waited, self.nothing = {}, None

    def due(self, steps: Sequence[Step]) -> list[Step]:
        """The steps whose time is over, of all that there are."""
        before, self.came_up = self.came_up, frozenset(one.key for one in steps if one.rolled_out or self.up(one))
        failing = [step for step in steps if self.failing(step)]
        known = {key: seconds for key, seconds in self.waited.items() if key in before or key not in self.came_up}
        self.rested = {
            one.key: self.rested.get(one.key, 0.0) + self._passed
            for one in steps
            if one.key in known and one not in failing
        }
        resting = {key: known[key] for key, seconds in self.rested.items() if seconds < FORGIVEN}
        waiting = {one.key: known[one.key] + self._passed if one.key in known else 0.0 for one in failing}
        self.waited = {**resting, **waiting}
        return [step for step in failing if step.begun or self._died(step) or self._late(step)]

    def _died(self, step: Step) -> str:
        return "" if self.up(step) else step.error

    def _late(self, step: Step) -> bool:
        return self.waited[step.key] >= step.ready_timeout

    def up(self, step: Step) -> bool:
        """Whether all of it was rolled out at some time."""
        return step.key in self.came_up

    def why(self, step: Step) -> str:
        code = self._died(step)
        if code:
            return f"ended with exit code {code}"
        return f"{'crashed again and again' if self.up(step) else 'not ready'} {self.waited[step.key]:.0f} s"

    def failing(self, step: Step) -> bool:
        return step.failing(self.up(step))


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
    return _revision(deployment["spec"]["template"]["metadata"])


def _revision(pod: Object) -> str:
    label = (pod.get("labels") or {}).get(REVISION)
    return str(label or (pod.get("annotations") or {}).get(HASH, "")[:8])
