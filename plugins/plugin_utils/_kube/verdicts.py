# SPDX-License-Identifier: GPL-3.0-or-later
"""Is it rolled out? Our own verdicts per kind, from the object's status and from what belongs to it.

kubernetes.core's waiters, and in part `kubectl rollout status`, pass states that are not rolled out: none of the new
pods up, a paused Deployment with a new template, old pods that still terminate. Two ROS 1 nodes of one name fight for
that name, so here the old pods have to be gone, not only outnumbered.

Pure: a `View` holds what is known of the cluster, `judge` gives the verdict. What the API does not show yet (the
object, its controller's answer, a replica set) is a `wait`, never an error.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from ...module_utils._common.poll import FAIL, PASS, WAIT
from ...module_utils._step.objects import Object, annotations_of, is_ready, is_terminating, labels_of, name_of
from .cache import Ref, View, has_rollout, owned_by
from .pods import REFUSED, UNSCHEDULABLE, Verdict, condition, controller_of, meta, verdict_on

REVISION = "deployment.kubernetes.io/revision"
HASH = "controller-revision-hash"
WORKLOADS = ("Deployment", "DaemonSet")


def _number(data: Object, key: str, default: int = 0) -> int:
    value = data.get(key)
    return default if value is None else int(value)


def _unseen(obj: Object) -> Verdict | None:
    """Nothing in the status counts until the controller has seen the present specification."""
    if is_terminating(obj):
        return Verdict(WAIT, "is being deleted")
    wanted, seen = _number(meta(obj), "generation"), _number(obj.get("status") or {}, "observedGeneration")
    return Verdict(WAIT, f"its controller has not seen generation {wanted} yet") if seen < wanted else None


def _worst(pods: Iterable[Object], view: View) -> Verdict | None:
    """The first failing pod's verdict, else the first suspicious one.

    While other pods are still terminating, their resources, ports and volumes come free soon: then "unschedulable" is
    an ordinary wait.
    """
    found = [verdict_on(pod) for pod in pods]
    room_is_coming = any(is_terminating(pod) for pod in view.all("Pod"))
    suspects = [one for one in found if one.suspect and not (room_is_coming and one.suspect == UNSCHEDULABLE)]
    return next((one for one in found if one.verdict == FAIL), next(iter(suspects), None))


def _with_pods(summary: str, pods: Iterable[Object]) -> str:
    reasons = [verdict_on(pod).reason for pod in pods if not is_ready(pod)]
    more = [f"and {len(reasons) - 3} more"] if len(reasons) > 3 else []
    return f"{summary}: {'; '.join([*reasons[:3], *more])}" if reasons else summary


def _old_left(pods: Sequence[Object]) -> str:
    first = pods[0]
    node = (first.get("spec") or {}).get("nodeName")
    doing = "is terminating" if is_terminating(first) else "still runs"
    more = f" and {len(pods) - 1} more" if len(pods) > 1 else ""
    return f"old pod {name_of(first)} {doing}" + (f" on {node}" if node else "") + more


def _all_pods(ref: Ref, view: View) -> list[Object]:
    """All that bear its name: of this template, of earlier ones, of replica sets that are deleted, of a namesake."""
    found = []
    for pod in view.all("Pod", ref.namespace):
        owner = controller_of(pod)
        kind, name = owner.get("kind"), str(owner.get("name", ""))
        if kind == "ReplicaSet":
            kind, name = "Deployment", name.rpartition("-")[0]
        if (kind, name) == (ref.kind, ref.name):
            found.append(pod)
    return found


def _current_pods(ref: Ref, obj: Object, view: View) -> list[Object]:
    """Those of the present template that are to stay."""
    newest = _newest(ref, obj, view)
    pods = [pod for pod in _all_pods(ref, view) if newest and not is_terminating(pod)]
    if ref.kind == "Deployment":
        return [pod for pod in pods if newest and owned_by(pod, newest)]
    return [pod for pod in pods if owned_by(pod, obj) and labels_of(pod).get(HASH) == labels_of(newest).get(HASH)]


def _newest(ref: Ref, obj: Object, view: View) -> Object | None:
    """The replica set, or the controller revision, of the present template; None until the API has shown it to us."""
    kind = "ReplicaSet" if ref.kind == "Deployment" else "ControllerRevision"
    owned = [one for one in view.all(kind, ref.namespace) if owned_by(one, obj)]
    newest = max(owned, key=_revision, default=None)
    return newest if newest and _revision(newest) >= _revision(obj) else None


def _revision(obj: Object) -> int:
    value = str(annotations_of(obj).get(REVISION) or obj.get("revision"))
    return int(value) if value.isdigit() else 0


# --- Deployment -----------------------------------------------------------------------------------------------------


def _deadline(obj: Object, current: Sequence[Object]) -> Verdict | None:
    """ProgressDeadlineExceeded, unless it is a leftover.

    After a change back to an earlier template the controller keeps the old condition until the first progress. So it
    counts at once only if a present pod already existed then; otherwise it has to last.
    """
    progressing = condition(obj, "Progressing")
    if progressing.get("reason") != "ProgressDeadlineExceeded":
        return None
    reason = _with_pods(f"ProgressDeadlineExceeded: {progressing.get('message', '')}".rstrip(": "), current)
    since = str(progressing.get("lastTransitionTime") or "")
    born = [str(meta(pod).get("creationTimestamp") or "") for pod in current]
    if not since or any(when <= since for when in born):  # both are UTC in one format: text order is time order
        return Verdict(FAIL, reason)
    return Verdict(WAIT, reason, suspect="ProgressDeadlineExceeded")


def _refused(obj: Object, old: Sequence[Object]) -> Verdict | None:
    """No pod may be made (quota, admission). An old pod that goes may free what is missing."""
    found = condition(obj, REFUSED)
    if found.get("status") != "True":
        return None
    reason = f"its pods are refused: {found.get('reason', '')}: {found.get('message', '')}"
    going = any(is_terminating(pod) for pod in old)
    return Verdict(WAIT, reason, suspect="" if going else REFUSED)


def _deployment_waits(obj: Object, current: Sequence[Object], old: Sequence[Object]) -> str:
    """The first thing that is not as it should be, or nothing."""
    status = obj.get("status") or {}
    desired = _number(obj.get("spec") or {}, "replicas", 1)
    updated, replicas = _number(status, "updatedReplicas"), _number(status, "replicas")
    available, unavailable = _number(status, "availableReplicas"), _number(status, "unavailableReplicas")
    if updated < desired:
        return _with_pods(f"{updated} of {desired} pods updated", current)
    ready = sum(map(is_ready, current))
    if old:  # that it works on while the new one is not ready is no fault
        unready = ready < len(current)
        return _with_pods(f"{ready} of {desired} new pods ready", current) if unready else _old_left(old)
    if replicas > updated:
        return f"{replicas - updated} old pods left"
    if available < desired or unavailable:
        return _with_pods(f"{available} of {desired} pods available", current)
    if updated > desired or len(current) != desired:
        return f"{len(current)} pods seen, {desired} wanted"
    return ""


def _deployment(ref: Ref, obj: Object, view: View) -> Verdict:
    newest, current = _newest(ref, obj, view), _current_pods(ref, obj, view)
    old = [pod for pod in _all_pods(ref, view) if pod not in current]
    unseen = "" if newest else "its replica set has not been seen yet"
    waits = _deployment_waits(obj, current, old if newest else []) or unseen
    paused = bool((obj.get("spec") or {}).get("paused"))
    if paused and waits:
        return Verdict(WAIT, f"paused, so its template does not roll out ({waits}): resume it", suspect="Paused")
    refused = _refused(obj, old) if waits else None
    lasting = refused if refused and refused.suspect else None
    if found := _worst(current, view) or lasting or _deadline(obj, current) or refused:
        return found
    if waits:
        return Verdict(WAIT, waits)
    desired = _number(obj.get("spec") or {}, "replicas", 1)
    return Verdict(PASS, f"{desired} of {desired} pods updated and available" + (", paused" if paused else ""))


# --- DaemonSet ------------------------------------------------------------------------------------------------------


def _daemon_waits(obj: Object, pods: Sequence[Object], current: Sequence[Object], behind: Sequence[Object]) -> str:
    """The first thing that is not as it should be, or nothing."""
    status = obj.get("status") or {}
    desired = _number(status, "desiredNumberScheduled")
    available = min(_number(status, "numberAvailable"), desired - _number(status, "numberUnavailable"))
    going = [pod for pod in pods if is_terminating(pod)]
    if behind:
        return _with_pods(f"{len(current)} of {desired} pods updated, {_old_left(behind)}", current)
    if going:
        return _old_left(going)
    if available < desired:
        return _with_pods(f"{available} of {desired} pods available", pods)
    # more may be there: it keeps pods on nodes that it would not choose any more
    return f"{len(pods)} pods seen, {desired} wanted" if len(pods) < desired else ""


def _daemon_set(ref: Ref, obj: Object, view: View) -> Verdict:
    if _newest(ref, obj, view) is None:
        return Verdict(WAIT, "its controller revision has not been seen yet")
    pods, current = _all_pods(ref, view), _current_pods(ref, obj, view)
    older = [pod for pod in pods if pod not in current and not is_terminating(pod)]
    on_delete = ((obj.get("spec") or {}).get("updateStrategy") or {}).get("type") == "OnDelete"
    left = [pod for pod in older if on_delete and owned_by(pod, obj)]  # those of a deleted namesake have to go
    if found := _worst(current, view):
        return found
    if waits := _daemon_waits(obj, pods, current, [pod for pod in older if pod not in left]):
        return Verdict(WAIT, waits)
    desired = _number(obj.get("status") or {}, "desiredNumberScheduled")
    note = f", {len(left)} left at an older revision (OnDelete)" if left else ""
    return Verdict(PASS, f"{desired} of {desired} pods available{note}" if desired else "no node wants it")


# --- claim, node ----------------------------------------------------------------------------------------------------


def _unbound(claim: Object, view: View) -> str:
    """What a claim without a volume waits for; nothing where that is its first consumer."""
    name = (claim.get("spec") or {}).get("storageClassName")
    if "StorageClass" in view.hidden:
        return "these credentials may not read storage classes"
    if name is None:
        return "no storage class is named and none is the default"
    found = view.get("StorageClass", "", str(name))
    if name and found is None:
        return f"storage class {name} does not exist"
    return "" if (found or {}).get("volumeBindingMode") == "WaitForFirstConsumer" else "no volume is bound yet"


def _claim(claim: Ref, obj: Object, view: View, refs: Iterable[Ref]) -> Verdict:
    phase = str((obj.get("status") or {}).get("phase") or "Pending")
    if phase == "Bound":
        return Verdict(PASS, f"bound to {(obj.get('spec') or {}).get('volumeName', '?')}")
    if phase == "Lost":
        return Verdict(FAIL, "Lost: its volume is gone")
    if why := _unbound(obj, view):
        return Verdict(WAIT, f"{phase}: {why}")
    for ref in (one for one in refs if one.kind in WORKLOADS and one.namespace == claim.namespace):
        spec = (view.get(ref.kind, ref.namespace, ref.name) or {}).get("spec") or {}
        volumes = ((spec.get("template") or {}).get("spec") or {}).get("volumes") or []
        used = any((one.get("persistentVolumeClaim") or {}).get("claimName") == claim.name for one in volumes)
        if used and _number(spec, "replicas", 1) > 0:
            return Verdict(WAIT, f"waits for the pod of {ref.kind} {ref.name}, its first consumer")
    return Verdict(PASS, "waits for its first consumer, and none of the given workloads is one")


def _node(obj: Object) -> Verdict:
    ready = condition(obj, "Ready")
    if ready.get("status") != "True":
        why = f"{ready.get('reason', '')}: {ready.get('message', '')}".strip(": ")
        return Verdict(WAIT, "NotReady" + (f": {why}" if why else ""))
    for kind in ("NetworkUnavailable", "MemoryPressure", "DiskPressure", "PIDPressure"):
        found = condition(obj, kind)
        if found.get("status") == "True":
            return Verdict(WAIT, f"{kind}: {found.get('message', '')}".rstrip(": "))
    return Verdict(PASS, "Ready" + (", cordoned" if (obj.get("spec") or {}).get("unschedulable") else ""))


# --- all kinds ------------------------------------------------------------------------------------------------------


def judge(ref: Ref, view: View, refs: Sequence[Ref] = ()) -> Verdict:
    """The verdict on one object; `refs` are all that are waited for together."""
    if not has_rollout(ref):
        return Verdict(PASS, f"a {ref.kind} has no rollout")
    obj = view.get(ref.kind, ref.namespace, ref.name)
    if obj is None:
        return Verdict(WAIT, "is not there yet")
    if unseen := _unseen(obj):
        return unseen
    if ref.kind in WORKLOADS:
        return (_deployment if ref.kind == "Deployment" else _daemon_set)(ref, obj, view)
    return _node(obj) if ref.kind == "Node" else _claim(ref, obj, view, refs)


def present_pods(ref: Ref, view: View) -> list[Object]:
    """The pods of the present template that are to stay: whose news are news of this rollout."""
    obj = view.get(ref.kind, ref.namespace, ref.name) if has_rollout(ref) and ref.kind in WORKLOADS else None
    return _current_pods(ref, obj, view) if obj and not _unseen(obj) else []


def leaving_pods(ref: Ref, view: View) -> list[Object]:
    """The pods of a Deployment that are told to end."""
    return [pod for pod in _all_pods(ref, view) if is_terminating(pod)] if ref.kind == "Deployment" else []


class Tracker:
    """Turns a suspicious wait into a failure once it has lasted `grace` seconds by our own clock.

    Our own clock, because the conditions' time stamps come from other machines, and a robot's clock may be far off.
    """

    def __init__(self, grace: float) -> None:
        self._grace = grace
        self._since: dict[tuple[Ref, str], float] = {}  # by object and suspicion

    def settle(self, ref: Ref, verdict: Verdict, now: float) -> Verdict:
        key = (ref, verdict.suspect)
        for other in [one for one in self._since if one[0] == ref and one != key]:
            del self._since[other]
        lasts = bool(verdict.suspect) and now - self._since.setdefault(key, now) >= self._grace
        return Verdict(FAIL, verdict.reason, verdict.suspect) if lasts else verdict

    def due(self) -> float | None:
        """When the next suspicion turns into a failure if nothing changes."""
        return min(self._since.values()) + self._grace if self._since else None
