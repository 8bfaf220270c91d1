# SPDX-License-Identifier: GPL-3.0-or-later
"""The robot's cluster, asked in the process of the action: one connection for a whole update."""

from __future__ import annotations

import contextlib
import os
import secrets
import socket
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

from ...module_utils._common.errors import KubeError
from ...module_utils._step.objects import labels_of
from ...module_utils._step.words import KEEPER, LEASE_SECONDS, OWNER
from .._kube.applied import Applied
from .._kube.cache import Ref, parse_refs
from .._kube.client import Kube, ref_of
from .._kube.connection import ApiError
from .._kube.door import KeeperDoor
from .._kube.lease import Lease
from .._kube.wait import WaitOptions, wait_for_rollout
from .._model import names
from .._model.context import Robot, master_namespace
from .._objects.namespace import needs_fleet_namespace
from .._objects.network import API, KIND
from .._objects.placement import CHOOSES, node_selector
from .world import HeldError, Live, LostError, Object, ticking

RENEW_SECONDS = 5.0
SURE_SECONDS = 10.0  # so long a write may be begun without asking: it may take a while to reach the API
TAKE_PAUSE = 0.5  # seconds between two looks whether another run's Lease is renewed
KEEPER_SECONDS = 2.0 * LEASE_SECONDS  # for a keeper that takes back what a killed run has left: most are done in one
SERVER_LABELS = ("node-role.kubernetes.io/control-plane", "node-role.kubernetes.io/master")
# Live's fields: what is in them
KINDS = {
    "deployments": ("Deployment", "apps/v1"), "maps": ("ConfigMap", "v1"), "services": ("Service", "v1"),
    "pods": ("Pod", "v1"), "policies": (KIND, API),
}  # fmt: skip


def run_name(known: Mapping[str, object]) -> str:
    """The run with these variables, as another one's operator can find it.

    Two robots' workers of one run have the rest in common; containers may have host name and process in common.
    """
    own = secrets.token_hex(4)
    if "awx_job_id" in known:  # of AWX, Ascender and Automation Platform
        return f"AWX job {known['awx_job_id']} ({known.get('awx_job_template_name', 'without a template')}), {own}"
    return f"{socket.gethostname()}, process {os.getppid()} ({own})"


class KubeCluster:
    """The Kubernetes API of the robot's cluster. KubeError where it is away for longer than a restart takes.

    `say` gets what is still open, every ten seconds of a wait; `holder` is who has the robot meanwhile.
    """

    def __init__(self, kube: Kube, say: Callable[[str], None], holder: str) -> None:
        self._kube, self._say, self._holder = kube, say, holder
        self._writer = kube.allowed_by(self.confirm)  # before every try: the Lease may end while the API is away
        self._claims: list[_Claim] = []
        self._restarts: dict[str, dict[str, int]] = {}  # by pod uid, those that it had before this run

    def read(self, namespaces: Iterable[str]) -> Live:
        """What these namespaces have, of ours only."""
        wanted = [(part, namespace) for part in KINDS for namespace in namespaces]
        ours = f"app.kubernetes.io/managed-by={names.MANAGER}"
        with ThreadPoolExecutor(len(wanted)) as pool:
            lists = list(pool.map(lambda one: self._kube.objects(KINDS[one[0]][0], one[1], ours), wanted))
        found: dict[str, list[Object]] = {part: [] for part in KINDS}
        for (part, _namespace), items in zip(wanted, lists, strict=True):
            kind, version = KINDS[part]
            # the items of a list do not say what they are
            found[part] += [{**item, "apiVersion": version, "kind": kind} for item in items]
        return Live(**found, homes={})

    def unlabelled(self, robot: Robot) -> bool:
        """Whether nodes of its pods are known by the labels of 1.0 alone: the role node was not there since."""
        for place in sorted({robot.master.placement, *(app.placement for app in robot.apps)}):
            [(label, value)] = node_selector(place, robot.name, old=True).items()
            nodes = self._kube.objects("Node", labels=f"{label}={value}")
            # one of several is enough: a robot that says it were an edge host changes nothing by that
            if nodes and not any(CHOOSES[place][0] in labels_of(node) for node in nodes):
                return True
        return False

    def door(self, robot: Robot) -> KeeperDoor:
        return KeeperDoor(self._kube, master_namespace(robot), robot.namespace, self._holder)

    @contextlib.contextmanager
    def claim(self, namespace: str) -> Iterator[None]:
        """Be the only run that changes what is in this namespace; HeldError names who is. It ends with its run."""
        # what cannot be renewed within its time need not be renewed for longer
        lease = Lease(self._kube.within(LEASE_SECONDS), namespace, self._holder)
        claim = self._take(lease)
        self._claims.append(claim)
        try:
            with ticking(RENEW_SECONDS, claim.go_on):
                yield
        finally:
            self._claims.remove(claim)
            with contextlib.suppress(KubeError):  # then it ends by itself
                lease.release()

    def confirm(self) -> None:
        """Whether all that was claimed is still this run's; LostError says whose it is."""
        for claim in self._claims:
            claim.confirm()

    def _take(self, lease: Lease) -> _Claim:
        """A holder that lives renews its Lease; one that was killed does not, and its time runs out.

        The update of another tool writes it once, for as long as that may take.
        """
        claim, hold = _Claim(lease), lease.acquire()  # its time begins before it is asked for
        if hold.holder.startswith(OWNER) and time.time() < hold.until:
            raise HeldError(f"{hold.holder} holds this robot since {hold.since}; let that end")
        if not hold.mine:
            self._say(f"waits whether the run of {hold.holder}, which began {hold.since}, still lives")
        first, waited = hold.renewed, 0.0
        while not hold.mine:
            if hold.renewed != first and (hold.holder != KEEPER or waited > KEEPER_SECONDS):
                raise HeldError(f"{hold.holder} changes this robot since {hold.since}; let that run end")
            time.sleep(TAKE_PAUSE)
            waited += TAKE_PAUSE
            claim, hold = _Claim(lease), lease.acquire()
        return claim

    def apply(self, objects: Sequence[Object], dry_run: bool = False) -> Sequence[Applied]:
        """In this order. After an error some of them may be applied; none after a LostError."""
        return self._writer.apply(objects, dry_run)

    def delete(self, objects: Sequence[Object], dry_run: bool = False) -> Sequence[Applied]:
        """What is not there is no error. An object with a uid is deleted if it is that very one."""
        return self._writer.delete(map(ref_of, objects), dry_run)

    def wait(self, objects: Sequence[Object], timeout: float, stay: float | None = None, begun: bool = False) -> None:
        """Until all are rolled out and the old pods are gone; NotReadyError, at once where waiting does not help.

        `stay`: then for so many seconds more, and at once if a container ends meanwhile. What a pod had ended by itself
        before this run is none of it, whatever else this run has waited for. `begun`: as strict, and only until new
        pods run beside the old ones, or have no place before these have gone; with minReadySeconds: until Ready.
        """
        refs = parse_refs([dict(item) for item in objects])
        how = WaitOptions(timeout, begun=begun, say=self._say)
        if begun or stay is not None:
            how = replace(how, fail_on_restart=True, watched=stay or 0.0, before=self._restarts)
        if refs:
            wait_for_rollout(self._kube, refs, how)

    def beat(self, node: str) -> str:
        """When the node's kubelet was last heard of, in its own words; empty where it never was."""
        lease = self._kube.get(Ref("Lease", node, "kube-node-lease", "coordination.k8s.io/v1")) or {}
        return str((lease.get("spec") or {}).get("renewTime") or "")


def awake_or_not() -> float:
    """Seconds that go on while this machine sleeps: a Lease does not wait for it."""
    return time.clock_gettime(getattr(time, "CLOCK_BOOTTIME", time.CLOCK_MONOTONIC))


class _Claim:
    """A Lease that is ours, and whether it still is."""

    def __init__(self, lease: Lease, now: Callable[[], float] = awake_or_not) -> None:
        self._lease, self._now = lease, now
        self._at, self._lost = now(), ""

    def confirm(self) -> None:
        """LostError if it is another one's; KubeError where the API cannot say so.

        One that was not renewed for about its time may be, so then the API is asked.
        """
        if not self._lost and self._now() - self._at >= SURE_SECONDS:
            try:
                self._renew()
            except ApiError as error:
                text = f"This run's Lease on the robot may be over, nothing is written until it is renewed: {error}"
                raise ApiError(text, error.status, error.transient) from error
        if self._lost:
            raise LostError(self._lost)

    def go_on(self) -> None:
        with contextlib.suppress(KubeError):  # the next time may do
            if not self._lost:
                self._renew()

    def _renew(self) -> None:
        sent = self._now()
        hold = self._lease.renew()
        self._at = sent  # the answer may have come long after it
        if not hold.mine:
            who = f"{hold.holder} has this robot since {hold.since}" if hold.holder else "another one had this robot"
            self._lost = f"{who}, as this run could not renew its Lease for {LEASE_SECONDS} s"


# --- a cluster of which one node is to be changed ---------------------------------------------------------------------


def robots_on(kube: Kube, node: str, robots: Iterable[Robot]) -> list[Robot]:
    """Those of which a pod is on the node, and those that need one of the whole fleet's which is; KubeError."""
    pods = kube.objects("Pod", fields=f"spec.nodeName={node}")
    there = {str(pod["metadata"]["namespace"]) for pod in pods}
    at_fleets = names.FLEET_NAMESPACE in there
    return [
        robot
        for robot in robots
        # a standalone one's fleet namespace is in a cluster of its own
        if robot.namespace in there or (at_fleets and needs_fleet_namespace(robot) and robot.mode != "standalone")
    ]


def is_server(node: Object) -> bool:
    return any(label in labels_of(node) for label in SERVER_LABELS)
