# SPDX-License-Identifier: GPL-3.0-or-later
"""What a pod's status says: ready or not, why not, and whether waiting can mend it. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from ...module_utils._common.poll import FAIL, WAIT
from ...module_utils._step.objects import Object, is_ready, is_terminating, name_of
from ...module_utils._step.words import HOPELESS, READINESS

# The kubelet says so itself: nothing changes until somebody changes the image, the configuration or the cluster.
IMAGE_ERRORS = frozenset(
    {"ErrImagePull", "ImagePullBackOff", "InvalidImageName", "ErrImageNeverPull", "ImageInspectError"}
)
CONFIG_ERRORS = frozenset({"CreateContainerConfigError"})
# The runtime could not make or start the container. Often lasting (no such command), sometimes a time-out of the
# container runtime on a busy robot; so these must last a while before they count.
RUNTIME_ERRORS = frozenset({"CreateContainerError", "RunContainerError", "CreatePodSandboxError"})
CRASH_LOOP = "CrashLoopBackOff"
UNSCHEDULABLE, REFUSED = "Unschedulable", "ReplicaFailure"
# These say that the kubelet itself was too slow, not that the configuration is wrong.
KUBELET_TOO_SLOW = ("failed to sync", "timed out", "context deadline exceeded")
NO_PYTHON = '"python3": executable file not found in $PATH'
UNSEEN = "nobody has looked at it yet (kubectl logs deploy/ros-keeper)"
HINT = "the image has no Python 3.8 for our code in the pod: write hooks: sidecar, with host_network hooks: none"


@dataclass(frozen=True)
class Verdict:
    """`pass`, `wait` or `fail`, and why.

    A `wait` with a `suspect` becomes a failure when it lasts (see `verdicts.Tracker`): the suspect names what has to
    last, so that its message may change meanwhile.
    """

    verdict: str
    reason: str
    suspect: str = ""


def meta(obj: Object) -> Object:
    return dict(obj.get("metadata") or {})


def space_of(obj: Object) -> str:
    return str(meta(obj).get("namespace") or "")


def uid_of(obj: Object) -> str:
    return str(meta(obj).get("uid", ""))


def grace_of(pod: Object) -> float:
    """Seconds that a pod has for its end, once it is told to end."""
    return float(meta(pod).get("deletionGracePeriodSeconds") or 0)


def condition(obj: Object, kind: str) -> Object:
    """The status condition of that type, or an empty one."""
    said = (obj.get("status") or {}).get("conditions") or []
    return dict(next((item for item in said if item.get("type") == kind), {}))


def controller_of(obj: Object) -> Object:
    """The owner reference of the object's controller, or an empty one."""
    owners = meta(obj).get("ownerReferences") or []
    return dict(next((owner for owner in owners if owner.get("controller")), {}))


def running(pod: Object) -> list[Object]:
    """What its status says of the containers that run, sidecars too; of none once it is told to end."""
    inits = (pod.get("spec") or {}).get("initContainers") or []
    passing = [one["name"] for one in inits if one.get("restartPolicy") != "Always"]  # those that stay: KEP-753
    now = [one for one in containers(pod) if "running" in (one.get("state") or {}) and one.get("name") not in passing]
    return [] if is_terminating(pod) else now


def waits_for_probe(pod: Object) -> bool:
    """Whether a container runs and is not ready: only its probe knows why. Of a readiness gate its condition tells."""
    return not is_ready(pod) and any(not one.get("ready") for one in running(pod))


def containers(pod: Object) -> Iterator[Object]:
    """What its status says of each, of init containers first."""
    status = pod.get("status") or {}
    for key in ("initContainerStatuses", "containerStatuses"):
        yield from status.get(key) or []


def _words(*parts: str) -> str:
    return ": ".join(part.strip() for part in parts if part and part.strip())


def _message(state: Object) -> str:
    """What was said of a container, and what may be done about it."""
    return str(state.get("message") or "").replace(NO_PYTHON, f"{NO_PYTHON} ({HINT})")


def _exit(ended: Object) -> str:
    """'exit code 1, signal 9 (Error): what it left as its last message'."""
    signal = f", signal {ended['signal']}" if ended.get("signal") else ""
    why = f" ({ended['reason']})" if ended.get("reason") else ""
    return _words(f"exit code {ended.get('exitCode', '?')}{signal}{why}", _message(ended))


def ends(container: Object) -> tuple[Object, Object]:
    """How the container ended, and how the one did that was there before it."""
    now, before = (container.get(key) or {} for key in ("state", "lastState"))
    return dict(now.get("terminated") or {}), dict(before.get("terminated") or {})


def _restarts(container: Object) -> str:
    again = int(container.get("restartCount") or 0)
    return f"{again} restart" + ("" if again == 1 else "s")


def _of_container(container: Object, who: str) -> Verdict | None:
    """Why it does not run, if so."""
    where = f"{who}, container {container.get('name', '?')}"
    waiting, (ended, last) = (container.get("state") or {}).get("waiting") or {}, ends(container)
    why, message = str(waiting.get("reason") or ""), _message(waiting)
    if why in IMAGE_ERRORS:
        return Verdict(FAIL, _words(where, why, f"image {container.get('image', '?')}", message))
    if why == CRASH_LOOP:  # by itself the kubelet restarts a first crash at once: without a restart it is no loop yet
        looped = bool(container.get("restartCount"))
        said = _words(where, CRASH_LOOP, _restarts(container) + (f", last {_exit(last)}" if last else ""))
        return Verdict(FAIL if looped else WAIT, said, "" if looped else CRASH_LOOP)
    if why in CONFIG_ERRORS and not any(slow in message for slow in KUBELET_TOO_SLOW):
        return Verdict(FAIL, _words(where, why, message))
    if waiting:
        lasting = why in RUNTIME_ERRORS or why in CONFIG_ERRORS
        return Verdict(WAIT, _words(where, why or "waiting", message), suspect=why if lasting else "")
    return Verdict(WAIT, _words(where, f"ended with {_exit(ended)}")) if ended.get("exitCode") else None


def verdict_on(pod: Object) -> Verdict:
    """What a pod that is not ready waits for, in one line, and whether waiting can mend it."""
    who = f"pod {name_of(pod)}"
    if is_terminating(pod):
        return Verdict(WAIT, f"{who} is terminating")
    found = [said for container in containers(pod) if (said := _of_container(container, who))]
    told = str(condition(pod, READINESS).get("message") or "")
    if told.startswith(HOPELESS):
        found.append(Verdict(FAIL, f"{who}: {told}"))
    scheduled = condition(pod, "PodScheduled")
    message = str(scheduled.get("message") or "")
    if scheduled.get("status") == "False" and scheduled.get("reason") == UNSCHEDULABLE:
        # The volume is still being made: that is its provisioner's work, not a verdict of the scheduler.
        unbound = "unbound immediate PersistentVolumeClaims" in message
        found.append(Verdict(WAIT, _words(who, UNSCHEDULABLE, message), suspect="" if unbound else UNSCHEDULABLE))
    elif scheduled.get("status") != "True" and not (pod.get("spec") or {}).get("nodeName"):
        found.append(Verdict(WAIT, _words(f"{who} is not scheduled yet", message)))
    found.append(Verdict(WAIT, _while_running(pod, who)))
    return min(found, key=lambda one: (one.verdict != FAIL, not one.suspect))


def _while_running(pod: Object, who: str) -> str:
    started = (pod.get("status") or {}).get("containerStatuses") or []
    waiting = [str(item.get("name", "?")) for item in started if not item.get("ready")]
    if waiting:
        return f"{who}, container {', '.join(waiting)}: not ready yet"
    for gate in (pod.get("spec") or {}).get("readinessGates") or []:
        kind = str(gate.get("conditionType", ""))
        said = condition(pod, kind)
        if said.get("status") != "True":
            unseen = UNSEEN if kind == READINESS else f"readiness gate {kind} is not True"
            return f"{who}: {said.get('message') or unseen}"
    ready = condition(pod, "Ready")
    phase = str((pod.get("status") or {}).get("phase") or "Pending")
    return _words(f"{who} is {phase}, not Ready", str(ready.get("reason") or ""), str(ready.get("message") or ""))


def restarts(pod: Object) -> dict[str, int]:
    """How often each of its containers was started again."""
    return {str(item.get("name", "?")): int(item.get("restartCount") or 0) for item in containers(pod)}


def error_end(pod: Object, before: Mapping[str, int]) -> Verdict | None:
    """A failure for a container that ended with an error even once, beyond the restarts that it had `before`."""
    for container in containers(pod):
        name = str(container.get("name", "?"))
        again = int(container.get("restartCount") or 0)
        for ended in ends(container)[: 2 if again > before.get(name, 0) else 1]:
            if ended.get("exitCode"):
                times = f" ({_restarts(container)})" if again else ""
                where = f"pod {name_of(pod)}, container {name}"
                return Verdict(FAIL, f"{where}: ended with {_exit(ended)}{times}")
    return None


def last_end(pod: Object) -> tuple[str, str] | None:
    """When one of its containers ended last and was started again, and how that was, in words.

    An end from before the pod's sandbox does not count: the host was started anew, and all its pods with it.
    """
    sandbox = str(condition(pod, "PodReadyToStartContainers").get("lastTransitionTime") or "")
    found = []
    for container in containers(pod):
        again, ended = int(container.get("restartCount") or 0), ends(container)[1]
        at = str(ended.get("finishedAt") or "")
        if again and at and at >= sandbox:
            times = f"restarted {again} time{'' if again == 1 else 's'}"
            found.append((at, _words(f"container {container.get('name', '?')} {times}, last", _exit(ended))))
    return max(found, default=None)
