# SPDX-License-Identifier: GPL-3.0-or-later
"""What keepers may write, beside their Roles: one ValidatingAdmissionPolicy (Kubernetes 1.30 and later). Pure.

A Role says which objects a keeper may write, and not what: with its token any image could run as root on the robot. So
the API server refuses what no keeper has to do. A Deployment stays as it is, unless a run has marked it. Then it may go
back: beside the mark the run writes what the version before is made of (`back_to`), a fact a line, and each fact of
what a keeper applies has to be one of these, or of what is there. Where they are too many, or an older collection wrote
the mark, it may go back to anything: a robot's way back comes first. The versions before, in the records, are for runs
to write, which apply them with rights of their own.

Evictions and Events need no rule. An eviction ends a pod of the robot, which its Deployment begins anew: that is what a
keeper is for, and a PodDisruptionBudget holds for it. An Event is text, of which nothing follows.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from ...module_utils._step.objects import Object
from ...module_utils._step.record import record_name
from ...module_utils._step.update_record import NAME as UPDATES
from ...module_utils._step.words import BACK_TO, HISTORY, KEEPER, LEASE, READINESS, SOAKING, UPDATING
from .._model import names
from .common import SELECTOR, made, owner_labels

NAME, API = "rosops-fleet-keeper", "admissionregistration.k8s.io/v1"

# --- what a version is made of: told by this code, and by the API server from the same table --------------------------

USER = ("runAsUser", "runAsGroup", "seccompProfile.type", "seccompProfile.localhostProfile", "seLinuxOptions.type")
MIGHT = ("privileged", "allowPrivilegeEscalation", "procMount", "capabilities.add", "capabilities.drop")
HOOKS = ("startupProbe", "readinessProbe", "livenessProbe", "lifecycle.postStart", "lifecycle.preStop")
FILES = ("configMap.name", "configMap.items", "secret.items")
KEYS = ("secretKeyRef.name", "secretKeyRef.key", "configMapKeyRef.name", "configMapKeyRef.key", "fieldRef.fieldPath")
# A part of a Deployment: the first word of a fact -> paths of what it tells. Of `entries` each key with its value is a
# fact; a word of `in ...` is a list, and each that is in it a fact.
TELLS: Mapping[str, Mapping[str, Sequence[str]]] = {
    "entries": {
        "label": ["metadata.labels", "spec.template.metadata.labels"],
        "note": ["spec.template.metadata.annotations"],
        "node": ["spec.template.spec.nodeSelector"],
    },
    "deployment": {"replicas": ["spec.replicas"]},
    "pod": {
        "account": ["serviceAccountName", "automountServiceAccountToken"],
        "host": ["hostNetwork", "hostPID", "hostIPC", "hostUsers", "runtimeClassName", "priorityClassName"],
        "user": [f"securityContext.{key}" for key in (*USER, "fsGroup", "supplementalGroups")],
    },
    "volumes": {"volume": ["hostPath.path", "secret.secretName", "persistentVolumeClaim.claimName", *FILES]},
    "in volumes": {"projected.sources": ["secret.name", *FILES]},
    "containers": {
        "image": ["image"],
        "run": ["command", "args", "workingDir", *(f"{hook}.exec.command" for hook in HOOKS)],
        "may": [f"securityContext.{key}" for key in (*USER, *MIGHT)],
    },
    "in containers": {
        "env": ["name", "value", *(f"valueFrom.{key}" for key in KEYS)],
        "envFrom": ["prefix", "configMapRef.name", "secretRef.name"],
        "volumeMounts": ["name", "mountPath", "subPath", "readOnly", "mountPropagation"],
        "ports": ["hostPort"],
    },
}
# `nodes`: by how many labels a node is chosen; `has`: fields that any such part has, whatever is in them
WORDS = [*(word for table in TELLS.values() for word in table), "nodes", "has"]
MOST = 400  # facts: to compare more may cost more than the API server spends on an expression, and it would refuse
OMITTED = ("hostNetwork", "hostPID", "hostIPC", "readOnly")  # by the API server, where it is false


def back_to(before: Object | None) -> dict[str, str]:
    """What a run writes beside its mark, as annotations: the facts of the version to go back to, if there is one."""
    facts = [*_facts(before)] if before else []
    return {BACK_TO: "\n".join(facts)} if len(facts) <= MOST else {}


def _facts(deployment: Object) -> Iterable[str]:
    """Those of what the API server fills in are not here: they are in whatever is there, too."""
    pod = deployment["spec"]["template"]["spec"]
    for word, paths in TELLS["entries"].items():
        entries = [entry for path in paths for entry in (_at(deployment, path) or {}).items()]
        yield from (f"{word} {key}={_flat(value)}" for key, value in entries)
    yield f"nodes {len(pod.get('nodeSelector') or ())}"
    parts: list[tuple[str, Object]] = [("deployment", deployment), ("pod", pod)]
    parts += [("volumes", one) for one in pod.get("volumes") or ()]
    parts += [("containers", one) for one in [*pod["containers"], *(pod.get("initContainers") or ())]]
    for kind, item in parts:
        name = item.get("name", kind)
        yield from (_line(f"{word} {name}", item, paths) for word, paths in TELLS[kind].items())
        yield from (f"has {kind} {key}" for key in item)
        for word, paths in TELLS.get(f"in {kind}", {}).items():
            yield from (_line(f"{word} {name}", one, paths) for one in _at(item, word) or ())


def _line(begin: str, item: Object, paths: Iterable[str]) -> str:
    values = [(path, _at(item, path)) for path in paths]
    told = [one for one in values if one[1] not in (None, "", []) and not (one[1] is False and one[0] in OMITTED)]
    return begin + "".join(f" {path}={_flat(value)}" for path, value in told)


def _flat(value: Any) -> str:
    """In one line."""
    if isinstance(value, (list, tuple)):
        return " | ".join(f"{one['key']}:{one['path']}" if isinstance(one, dict) else _flat(one) for one in value)
    return (str(value).lower() if isinstance(value, bool) else str(value)).replace("\n", "\\n")


def _at(item: Any, path: str) -> Any:
    for key in path.split("."):
        item = item.get(key) if isinstance(item, dict) else None
    return item


# The same in CEL. `t` is a path, `w` a word.

FLAT = r"replace('\n', '\\n')"
TEXT = f"(type(x) == list ? x.map(i, type(i) == map ? i.key + ':' + i.path : string(i)).join(' | ') : string(x)).{FLAT}"


def _cel_facts() -> str:
    """Those of the new Deployment, and those of the old one."""
    table = "variables.tells['entries']"
    entries = f".optMap(m, m.map(k, w + ' ' + k + '=' + m[k].{FLAT}).join('\\n')).orValue('')"
    facts = [
        f"{table}.map(w, {table}[w].map(t, {_cel_at('d', 't', entries)}).join('\\n'))",
        "['nodes ' + string(s.?nodeSelector.orValue({}).size())]",
        _cel_part("deployment", "[d]", "'deployment'"),
        _cel_part("pod", "[s]", "'pod'"),
        _cel_part("volumes", "s.?volumes.orValue([])"),
        _cel_part("containers", "(s.containers + s.?initContainers.orValue([]))"),
    ]
    of_both = f"[d.spec.template.spec].map(s, ({' + '.join(facts)}).join('\\n').split('\\n'))[0]"
    return f"[variables.new, variables.old].map(d, {of_both})"


def _cel_part(kind: str, items: str, name: str = "c.name") -> str:
    table, lists = f"variables.tells['{kind}']", f"variables.tells['in {kind}']"
    facts = [f"{table}.map(w, {_cel_line('c', name, table)})", f"c.map(k, 'has {kind} ' + k)"]
    if f"in {kind}" in TELLS:
        each = f".orValue([]).map(e, {_cel_line('e', name, lists)}).join('\\n')"
        facts.append(f"{lists}.map(w, {_cel_at('c', 'w', each)})")
    return f"{items}.map(c, ({' + '.join(facts)}).join('\\n'))"


def _cel_line(of: str, name: str, table: str) -> str:
    told = f".optMap(x, ' ' + t + '=' + {TEXT}).orValue('')"
    return f"w + ' ' + {name} + {table}[w].map(t, {_cel_at(of, 't', told)}).join('')"


def _cel_at(of: str, path: str, then: str) -> str:
    """What comes of what is there at a path of one to four keys."""
    one, two, three, four = (f"dyn({of}){''.join(f'[?p[{key}]]' for key in range(keys))}" for keys in range(1, 5))
    found = f"(p.size() == 1 ? {one} : p.size() == 2 ? {two} : p.size() == 3 ? {three} : {four})"
    return f"[{path}.split('.')].map(p, {found}{then})[0]"


# --- the policy -------------------------------------------------------------------------------------------------------


def _cel_same(part: str, *but: str) -> str:
    """Whether no key of it but these is new, has another value, or is gone."""
    new, old, free = f"variables.new.{part}", f"variables.old.{part}", [*but]
    same = f"{new}.all(k, k in {free} || (k in {old} && {new}[k] == {old}[k]))"
    return f"{same} && {old}.all(k, k in {free} || k in {new})"


MARKS, BOOKKEEPING = (UPDATING, SOAKING), ("managedFields", "resourceVersion", "generation")
OWNER, LIST = "app.kubernetes.io/managed-by", f"variables.was[?'{BACK_TO}']"
OTHERS = f"status.?conditions.orValue([]).filter(c, c.type != '{READINESS}')"
VARIABLES = {
    "new": "dyn(object)",  # of whatever kind
    "old": "dyn(oldObject)",
    "now": "variables.new.metadata.?annotations.orValue({})",
    "was": "variables.old.metadata.?annotations.orValue({})",
    "marked": f"{[*MARKS]}.exists(k, k in variables.was)",
    "tells": json.dumps(TELLS),
    "facts": _cel_facts(),
    "known": f"variables.facts[1] + {LIST}.orValue('').split('\\n')",
    "other": "variables.facts[0].filter(f, !(f in variables.known))",
    # never more of a fact than its word: it may have a secret
    "words": f"{WORDS}.filter(w, variables.other.exists(f, f.startsWith(w + ' '))).join(', ')",
}
# Of a kind of objects, what is allowed, in words and in CEL.
RULES: Mapping[str, Mapping[str, str]] = {
    "pods": {
        f"of a pod's status a keeper may set the condition {READINESS} alone, where the pod has its readiness gate":
        f"variables.old.spec.?readinessGates.orValue([]).exists(g, g.conditionType == '{READINESS}')"
        f" && {_cel_same('metadata', *BOOKKEEPING)} && {_cel_same('status', 'conditions')}"
        f" && variables.new.{OTHERS} == variables.old.{OTHERS}",
    },
    "deployments": {
        "of a Deployment's metadata a keeper may change annotations alone":
        f"{_cel_same('metadata', *BOOKKEEPING, 'labels', 'annotations')} && [[variables.new, variables.old], "
        f"[variables.new.spec.template, variables.old.spec.template]].all(p, {[*SELECTOR, names.LABEL_ROBOT, OWNER]}"
        ".all(k, p[0].metadata.?labels[?k] == p[1].metadata.?labels[?k]))",
        f"a keeper may take the marks {' and '.join(MARKS)} off a Deployment; to write these and {BACK_TO} is for runs":
        f"{[*MARKS]}.all(k, !(k in variables.now) || [k, '{BACK_TO}'].all(n, variables.now[?n] == variables.was[?n]))",
        "a keeper may change a Deployment only where a run has marked it, to take it back":
        "variables.marked || variables.new.spec == variables.old.spec",
        f"a keeper may take a Deployment back to the version of its annotation {BACK_TO} alone":
        f"!variables.marked || !{LIST}.hasValue() || variables.other.size() == 0",
    },
    "configmaps": {
        f"of ConfigMaps a keeper may write the data of {UPDATES} and of those named APP{record_name('')} alone":
        f"(variables.new.metadata.name == '{UPDATES}' || variables.new.metadata.name.endsWith('{record_name('')}'))"
        f" && variables.old.metadata.?labels[?'{OWNER}'].orValue('') == '{names.MANAGER}'"
        f" && {_cel_same('metadata', *BOOKKEEPING)}",
        f"which versions an app may go back to ({HISTORY}) is for runs to write":
        f"variables.new.?data[?'{HISTORY}'] == variables.old.?data[?'{HISTORY}']",
    },
    "leases": {f"of Leases a keeper may write {LEASE} alone": f"variables.new.metadata.name == '{LEASE}'"},
}  # fmt: skip
WRITTEN = ("/pods/status", "apps/deployments", "/configmaps", "coordination.k8s.io/leases")


def admission_objects() -> list[Object]:
    """The policy, and what puts it in force."""
    user = "request.userInfo.username"
    keepers = f"{user}.startsWith('system:serviceaccount:') && {user}.endsWith(':{KEEPER}')"
    validations = [_validation(kind, *rule) for kind, one in RULES.items() for rule in one.items()]
    return policy(NAME, dict.fromkeys(WRITTEN, ("CREATE", "UPDATE")), {"keepers": keepers}, VARIABLES, validations)


def policy(
    name: str,
    asked: Mapping[str, Sequence[str]],
    where: Mapping[str, str],
    variables: Mapping[str, str],
    validations: Sequence[Object],
) -> list[Object]:
    """A policy and what puts it in force. They are the cluster's, the same bytes from every robot.

    `asked` is group/resource -> the operations that it judges, `where` and `variables` are name -> CEL.
    """
    rules = []
    for one, operations in asked.items():
        group, _slash, kind = one.partition("/")
        versions = ["*" if group == "*" else "v1"]
        rules.append({"apiGroups": [group], "apiVersions": versions, "operations": [*operations], "resources": [kind]})
    named = {"matchConditions": where, "variables": variables}
    spec = {
        "failurePolicy": "Fail",
        "matchConstraints": {"resourceRules": rules},
        **{kind: [{"name": key, "expression": text} for key, text in found.items()] for kind, found in named.items()},
        "validations": [*validations],
    }
    force, labels = {"policyName": name, "validationActions": ["Deny"]}, owner_labels(None)
    return [
        made(API, "ValidatingAdmissionPolicy", name, labels=labels, spec=spec),
        made(API, "ValidatingAdmissionPolicyBinding", name, labels=labels, spec=force),
    ]


def _validation(kind: str, words: str, rule: str) -> Object:
    more = {"messageExpression": f"'{words}; what is in neither: ' + variables.words"} if "other" in rule else {}
    expression = f"request.resource.resource != '{kind}' || ({rule})"
    return {"expression": expression, "message": words, **more, "reason": "Forbidden"}
