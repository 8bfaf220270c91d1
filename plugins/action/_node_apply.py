# SPDX-License-Identifier: GPL-3.0-or-later
"""For the role node: wait until the host's node is Ready, then give it its labels and taints."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from ..module_utils._common.documents import Arguments, Result, Variables
from ..module_utils._common.errors import SpecError
from ..module_utils._common.poll import PASS
from ..module_utils._step.objects import Object
from ..plugin_utils._action.cluster import ClusterAction, written
from ..plugin_utils._kube.applied import Applied
from ..plugin_utils._kube.cache import Ref
from ..plugin_utils._kube.client import Kube
from ..plugin_utils._kube.connection import anew
from ..plugin_utils._kube.wait import WaitOptions, look_once, wait_for_rollout
from ..plugin_utils._model import names
from ..plugin_utils._objects.node import evicted, evicting, node_object, taints_patch, unplaced
from ..plugin_utils._objects.revocation import policy_name, refusal_of


class ActionModule(ClusterAction):
    ARGUMENTS: ClassVar = {
        "name": {"type": "str", "required": True},
        "placement": {"type": "str", "choices": ["local", "remote"], "required": True},
        "robot": {"type": "str", "default": ""},
        "labels": {"type": "dict", "default": {}},
        "taints": {"type": "list", "elements": "dict", "default": []},
        "timeout": {"type": "float", "default": 300},
    }

    def work(self, params: Arguments, known: Variables) -> Result:
        ref, node, check = Ref("Node", params["name"], "", "v1"), _node(params), self._task.check_mode
        with self.cluster(params, known) as kube:
            if kube.get(ref) is None:
                if kube.get(Ref("ValidatingAdmissionPolicyBinding", policy_name(ref.name))):
                    raise SpecError(f"It was left as it is: {refusal_of(ref.name)}.")
                if check:
                    return self.foresee(params, known)
            # Applying a node that is not there would create one: the wait comes first.
            if not check and look_once(kube, [ref])["objects"][0]["verdict"] != PASS:
                wait_for_rollout(kube, [ref], WaitOptions(timeout=params["timeout"], say=self.say(known)))
            _refuse_to_evict(kube, ref, params["taints"])
            done = kube.apply([*self._identity(known), node], check)
            for pod in _left_by_labels(kube, done[-1]):
                self.say(known)(f"{pod} works on, and is not started again on {ref.name} with the labels that it gets")
            return written([*done, *_taint(kube, ref, params["taints"], check)])

    def _identity(self, known: Variables) -> list[Object]:
        """What makes the cluster carry its fleet's identity, where it does not yet."""
        if self.adoption is None:
            return []
        self.say(known)(f"the cluster carries no identity of a fleet yet; it becomes {self.adoption}")
        return [self.adoption.as_object()]

    def foresee(self, params: Arguments, _known: Variables) -> Result:
        labels = _node(params)["metadata"]["labels"]
        what = f"it would get the labels {labels} and the taints {params['taints']}"
        return {"changed": True, "msg": f"node {params['name']} has not joined yet; {what}"}


def _node(params: Arguments) -> Object:
    return node_object(params["name"], params["placement"], params["robot"], params["labels"])


def _pods(kube: Kube, node: str) -> list[Object]:
    """Ours that run there."""
    ours = f"app.kubernetes.io/managed-by={names.MANAGER}"
    return kube.objects("Pod", labels=ours, fields=f"spec.nodeName={node},status.phase=Running")


def _refuse_to_evict(kube: Kube, ref: Ref, taints: Sequence[Object]) -> None:
    """SpecError where Kubernetes would end pods of ours at once, whatever they do."""
    new = evicting(kube.get(ref) or {}, taints) if any(taint["effect"] == "NoExecute" for taint in taints) else []
    if new and (ending := evicted(_pods(kube, ref.name), new)):
        names_of_them = ", ".join(str(taint["key"]) for taint in new)
        raise SpecError(
            f"{ref} was left as it is: the taint {names_of_them} with NoExecute would end {', '.join(ending)} at once, "
            "at work or not. Take the effect NoSchedule, which lets what runs stay, or give them a toleration first "
            "(overrides in their specification), which an update brings with the care of a step."
        )


def _left_by_labels(kube: Kube, change: Applied) -> list[str]:
    """Pods of ours that run on, though the node is none of theirs any more."""
    before, after = ((one or {}).get("metadata", {}).get("labels") or {} for one in (change.before, change.after))
    return unplaced(_pods(kube, change.ref.name), before, after) if change.changed else []


def _taint(kube: Kube, ref: Ref, taints: Sequence[Object], dry_run: bool) -> list[Applied]:
    """Kubernetes puts on and takes off taints of its own meanwhile."""

    def write() -> list[Applied]:
        patch = taints_patch(kube.get(ref) or {"metadata": {}}, taints)
        return [kube.merge(ref, patch, dry_run)] if patch else []

    return anew(write)
