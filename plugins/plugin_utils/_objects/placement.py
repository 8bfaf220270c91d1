# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a robot's pods go, and what of a host they may have there. Pure.

A node is chosen by a label that its own kubelet cannot set. So who is root on a robot gets no pod that is meant for the
edge or for another robot. And by a ValidatingAdmissionPolicy a pod has a host's file system, network or rights on its
robot's own node alone. Wherever else it may be placed, what it can do there is what any container can.
"""

from __future__ import annotations

from ...module_utils._step.objects import Object
from .._model import names
from .admission import policy
from .pod_security import CAPABILITIES, refused

NAME = "rosops-fleet-pods"
STORAGE = "/var/lib/rancher/k3s/storage"  # where k3s' class local-path has its volumes
# Placement -> the label that chooses its nodes, and the one that did so in 1.0, which a kubelet can set.
CHOOSES = {
    "local": (names.NODE_ROBOT, names.LABEL_ROBOT),
    "remote": (names.NODE_PLACEMENT, names.LABEL_PLACEMENT),
}


def node_selector(placement: str, robot: str, old: bool = False) -> dict[str, str]:
    """`local` is the robot itself, `remote` any edge host."""
    return {CHOOSES[placement][old]: robot if placement == "local" else "remote"}


def is_placed(pod: Object, placement: str) -> bool:
    """Whether a pod is placed so, by whichever label."""
    return any(label in (pod.get("nodeSelector") or {}) for label in CHOOSES[placement])


# --- what of a host: told by this code, and by the API server ---------------------------------------------------------

OF_HOST = ("hostNetwork", "hostPID", "hostIPC")
PREFIX = names.robot_namespace("")
ASKED = {"/pods": ("CREATE",), "/pods/ephemeralcontainers": ("UPDATE",)}
WHERE = f"request.namespace == '{names.FLEET_NAMESPACE}' || request.namespace.startsWith('{PREFIX}')"
VARIABLES = {
    "pod": "dyn(object).spec",
    # a kubelet that sets the old label on its own Node brings the pod to no other host than that
    "own": f"{[*CHOOSES['local']]}"
    f".exists(k, '{PREFIX}' + variables.pod.?nodeSelector[?k].orValue('') == request.namespace)",
    "free": f"variables.own || namespaceObject.metadata.?labels[?'{names.LABEL_HOST_ACCESS}'].orValue('') == 'true'",
    "containers": "variables.pod.containers"
    " + variables.pod.?initContainers.orValue([]) + variables.pod.?ephemeralContainers.orValue([])",
    "written": "variables.containers.map(c, c.?volumeMounts.orValue([]).filter(m, !m.?readOnly.orValue(false)))",
}
# What only a pod on its robot's own node may, in words and in CEL. A keeper on the edge tells what claims hold there.
RULES = {
    f"have {', '.join(OF_HOST)}": f"!{[*OF_HOST]}.exists(k, variables.pod[?k].orValue(false))",
    f"mount a path of its host, but {STORAGE} to read": "variables.pod.?volumes.orValue([]).all(v, !has(v.hostPath)"
    f" || (v.hostPath.path == '{STORAGE}' && !variables.written.exists(l, l.exists(m, m.name == v.name))))",
    "be privileged": "!variables.containers.exists(c, c.?securityContext.privileged.orValue(false))",
    "add capabilities that a container has not anyway": "variables.containers.all(c, "
    f"c.?securityContext.capabilities.add.orValue([]).all(one, one in {[*CAPABILITIES]}))",
}
# Mirror pods of static ones. A kubelet may give one any namespace and any labels, those of another robot's master, too.
KUBELETS = "a node makes no pods here"
OPENED = f"robot_namespace_edge_host_access=true (the label {names.LABEL_HOST_ACCESS} of the namespace) allows it"
OWN = f"on its robot's own node (nodeSelector {names.NODE_ROBOT}: NAME, in the namespace {PREFIX}NAME)"


def pod_policy() -> list[Object]:
    """What bounds pods in the namespaces of robots and in the fleet's, whoever makes them."""
    told = [(f"variables.free || ({rule})", f"only a pod {OWN} may {what}; {OPENED}") for what, rule in RULES.items()]
    told.append(("!request.userInfo.username.startsWith('system:node:')", KUBELETS))
    validations = [{"expression": rule, "message": words, "reason": "Forbidden"} for rule, words in told]
    return policy(NAME, ASKED, {"robots": WHERE}, VARIABLES, validations)


def of_other_host(pod: Object, namespace: str) -> list[str]:
    """What the policy refuses of a pod in the namespace, where that is not opened."""
    chosen = pod.get("nodeSelector") or {}
    if any(names.robot_namespace(chosen.get(label, "")) == namespace for label in CHOOSES["local"]):
        return []
    containers = [*pod["containers"], *(pod.get("initContainers") or ())]
    mounts = [one for each in containers for one in each.get("volumeMounts") or ()]
    written, volumes = [one.get("name") for one in mounts if not one.get("readOnly")], pod.get("volumes") or ()
    free = [one["name"] for one in volumes if (one.get("hostPath") or {}).get("path") == STORAGE]
    others = [one for one in volumes if one["name"] in written or one["name"] not in free]
    found = refused({**pod, "volumes": others}, "baseline")
    return [one for one in found if one.startswith((*OF_HOST, "hostPath", "privileged", "capability"))]
