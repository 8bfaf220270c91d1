# SPDX-License-Identifier: GPL-3.0-or-later
"""For the playbook revoke: end what a robot may do in its cluster, and say what is left for its user to change.

The robot itself is not asked. A standalone one has a cluster of its own, which went with it: there it is only said.
"""

from __future__ import annotations

from typing import ClassVar

from ..module_utils._common.documents import Arguments, Result, Variables
from ..module_utils._common.errors import NotReadyError
from ..module_utils._common.poll import PASS, WAIT, Seen, poll
from ..module_utils._step.objects import Object, holder_of, name_of
from ..module_utils._step.words import LEASE
from ..plugin_utils._action.cluster import ClusterAction, written
from ..plugin_utils._kube.applied import Applied
from ..plugin_utils._kube.cache import Ref
from ..plugin_utils._kube.client import Kube
from ..plugin_utils._kube.connection import ApiError
from ..plugin_utils._model.fleet import home_of, robot_from_vars
from ..plugin_utils._model.outcomes import UNCHANGED, UPDATED
from ..plugin_utils._objects.revocation import (
    NODES,
    REVOKER,
    SYSTEM,
    accounts_of,
    left_to_user,
    refusal_of,
    revocation_objects,
    tokens_of,
    user_of,
)
from ..plugin_utils._update.outcome import RobotOutcome

TOKENS = "type=bootstrap.kubernetes.io/token"


class ActionModule(ClusterAction):
    ARGUMENTS: ClassVar = {"timeout": {"type": "float", "default": 60}}

    def work(self, params: Arguments, known: Variables) -> Result:
        part, robot = home_of(known).part, robot_from_vars(known)
        said = self.variables(known, "k3s", "k3s_registries", "k3s_config")
        if part.role == "server":
            gone = ["nothing: it was a cluster of its own, and no other one has given it any rights"]
            return self._told(known, [], gone, left_to_user(robot, said))
        check, node = bool(self._task.check_mode), part.node
        with self.cluster(params, known) as kube:
            secrets, everywhere = kube.objects("Secret", robot.namespace), kube.objects("DaemonSet")
            accounts = accounts_of(_pods(kube, node))
            tokens = tokens_of(node, kube.objects("Secret", SYSTEM, fields=TOKENS))
            done = kube.apply(revocation_objects(node), check)
            if not check:
                _wait_for_force(kube, node, params["timeout"])
            done += kube.delete([Ref("Secret", name, SYSTEM, "v1") for name in tokens], check)
            done += _fenced(kube, robot.namespace, check)
            done += _swept(kube, node, params["timeout"], check)
        gone = [
            f"its tokens to join the cluster: {len(tokens)} that had not ended, and k3s makes none for it",
            f"its kubelet's certificate: the API server refuses whatever {user_of(node)} writes, it may read no Secret "
            "and no ConfigMap of ours any more, and k3s gives it no other one",
            f"the tokens of the pods on it: {', '.join(accounts) or 'it has none any more'}",
        ]
        return self._told(known, done, gone, left_to_user(robot, said, secrets, everywhere))

    def _told(self, known: Variables, done: list[Applied], gone: list[str], left: list[str]) -> Result:
        result, when = written(done), "once this is done" if self._task.check_mode else "now"
        parts = ((f"worth nothing {when}", gone), ("for you to change", left))
        listed = "\n".join("\n  ".join([f"{what}:", *lines]) for what, lines in parts)
        self.say(known)(listed)
        # its first line is what a table has room for
        reason = f"what it holds is worth nothing {when}; {len(left)} things are for you to change\n\n{listed}"
        outcome = RobotOutcome(UPDATED if result["changed"] else UNCHANGED, reason)
        return {**result, "gone": gone, "left": left, "outcome": outcome.as_dict()}


def _pods(kube: Kube, node: str) -> list[Object]:
    return kube.objects("Pod", fields=f"spec.nodeName={node}")


def _wait_for_force(kube: Kube, node: str, timeout: float) -> None:
    """Until the API server refuses what the node's kubelet would write next: to its Node, or a new one."""
    kubelet, ref = kube.acting_as(user_of(node), NODES), Ref("Node", node, "", "v1")
    own = {"apiVersion": "v1", "kind": "Node", "metadata": {"name": node}}

    def refused() -> Seen:
        try:
            if kube.get(ref):
                kubelet.merge(ref, {"metadata": {"annotations": {REVOKER: "tried"}}}, dry_run=True)
            else:
                kubelet.apply([own], dry_run=True)
        except ApiError as error:
            if error.status == 403 and refusal_of(node) in str(error):
                return Seen(PASS)
            raise
        return Seen(WAIT)

    if poll(refused, timeout, 0.5).verdict != PASS:
        raise NotReadyError(
            f"The policy that refuses what {user_of(node)} writes is not in force {timeout:.0f} s after it was made. "
            "Its Node, its pods and its tokens are as they were. Run this again."
        )


def _fenced(kube: Kube, namespace: str, check: bool) -> list[Applied]:
    """Whoever holds the robot's Lease, be it its keeper or a run, has it no more."""
    ref = Ref("Lease", LEASE, namespace, "coordination.k8s.io/v1")
    if holder_of(kube.get(ref) or {}) in ("", REVOKER):
        return []
    return [kube.merge(ref, {"spec": {"holderIdentity": REVOKER}}, check)]


def _swept(kube: Kube, node: str, timeout: float, check: bool) -> list[Applied]:
    """Delete its Node and its pods, until none is there twice.

    The scheduler may bind one in between, and on another server the policy may be in force a moment later.
    """
    done: list[Applied] = []

    def sweep() -> Seen:
        pods = [Ref("Pod", name_of(one), one["metadata"]["namespace"], "v1") for one in _pods(kube, node)]
        found = kube.delete([Ref("Node", node, "", "v1"), *pods], check, at_once=True)
        changed = [one for one in found if one.changed]
        done.extend(changed)
        return Seen(WAIT if changed and not check else PASS, ", ".join(str(one.ref) for one in changed))

    polled = poll(sweep, timeout, 1.0, 1 if check else 2)
    if polled.verdict != PASS:
        raise NotReadyError(f"These come again or do not go, after {timeout:.0f} s: {polled.last}")
    return done
