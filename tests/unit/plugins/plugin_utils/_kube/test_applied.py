# SPDX-License-Identifier: GPL-3.0-or-later
"""What is shown of a write; what others put into an object of ours, and how it becomes ours to take away."""

from __future__ import annotations

import copy
import json
import re
from typing import Any

from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.applied import (
    applied,
    applied_part,
    diff_of,
    foreign_fields,
    left_fields,
    taken_over,
    without_fields,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.cache import Ref

REF = Ref("Secret", "pull", "robot-robot1", "v1")


def secret(value: str, **metadata: Any) -> dict[str, Any]:
    return {"kind": "Secret", "metadata": {"name": "pull", **metadata}, "data": {"a": value, "same": "c2FtZQ=="}}


def test_a_secret_is_never_shown_but_its_change_is() -> None:
    copied = {"annotations": {"kubectl.kubernetes.io/last-applied-configuration": json.dumps(secret("b2xk"))}}
    (diff,) = diff_of([applied(REF, secret("b2xk", **copied), secret("bmV3"))])
    assert diff["before"]["data"] == {"a": "(hidden: the old value)", "same": "(hidden)"}
    assert diff["after"]["data"] == {"a": "(hidden: the new value)", "same": "(hidden)"}
    others = diff_of([applied(REF, None, secret("bmV3")), applied(REF, secret("bmV3"), None)])
    plain = diff_of([applied(REF, None, {**secret("bmV3"), "stringData": {"b": "b2xk"}})])
    assert not re.search("b2xk|bmV3|c2FtZQ==", str([diff, others, plain]))
    assert len(others) == 2


def test_bookkeeping_is_no_change() -> None:
    kept = {"resourceVersion": "1", "generation": 1, "managedFields": []}
    before = {"metadata": {"name": "a", **kept}, "status": {"a": 1}}
    after = {"metadata": {"name": "a", "resourceVersion": "2", "generation": 2}, "status": {}}
    assert not applied(Ref("Pod", "a", "n"), before, after).changed


def test_the_diff_has_what_changed_only() -> None:
    ref = Ref("ConfigMap", "a", "n")
    old, new = ({"metadata": {"name": "a"}, "data": {"k": value}} for value in "ab")
    written = [applied(ref, old, old), applied(ref, old, new), applied(ref, None, new), applied(ref, old, None)]
    assert [(one["before"], one["after"]) for one in diff_of(written)] == [(old, new), ("", new), (old, "")]
    assert diff_of(written)[0]["before_header"] == "ConfigMap n/a"


def test_bytes_are_shown_by_their_number_and_hash() -> None:
    (diff,) = diff_of([applied(REF, None, {"kind": "ConfigMap", "data": {"a": "b"}, "binaryData": {"c": "YWJj"}})])
    digest = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
    assert (diff["after"]["data"], diff["after"]["binaryData"]) == ({"a": "b"}, {"c": f"3 bytes, SHA-256 {digest}"})
    assert diff["before"] == ""


def deployment(password: str, level: str) -> dict[str, Any]:
    variables = [{"name": "DB_PASSWORD", "value": password}, {"name": "LEVEL", "value": level}]
    return {"kind": "Deployment", "metadata": {"name": "a"}, "spec": {"containers": [{"env": variables}]}}


def test_an_apps_password_is_not_shown_nor_where_the_way_back_keeps_it() -> None:
    old, new = deployment("first-hush", "1"), deployment("then-hush", "2")
    kept = {"kind": "ConfigMap", "metadata": {"name": "a-update"}, "data": {"history.json": json.dumps([old])}}
    app, history = diff_of([applied(REF, old, new), applied(REF, kept, None)])
    assert app["before"] == deployment("(hidden: the old value)", "1")
    assert app["after"] == deployment("(hidden: the new value)", "2")
    assert "hush" not in str([app, history])


# --- who set which fields ---------------------------------------------------------------------------------------------

US = "rosops.fleet"
APP, SIDECAR, EXTRA = 'k:{"name":"app"}', 'k:{"name":"shell"}', 'k:{"name":"DEBUG"}'
PORT = 'k:{"containerPort":80,"protocol":"TCP"}'
CONTAINER = {"name": "app", "image": "i:1", "env": [{"name": "A", "value": "1"}], "ports": [{"containerPort": 80}]}
WANTED: dict[str, Any] = {
    "apiVersion": "apps/v1",
    "kind": "Deployment",
    "metadata": {"name": "a", "namespace": "r"},
    "spec": {"replicas": 1, "template": {"spec": {"containers": [CONTAINER], "nodeSelector": {"kind": "robot"}}}},
}


def pod(fields: dict[str, Any]) -> dict[str, Any]:
    return {"f:template": {"f:spec": fields}}


def update(manager: str, spec: dict[str, Any], **more: Any) -> dict[str, Any]:
    return {"manager": manager, "operation": "Update", "fieldsV1": {"f:spec": spec}, **more}


OWN = {
    APP: {
        ".": {}, "f:name": {}, "f:image": {},
        "f:env": {'k:{"name":"A"}': {".": {}, "f:name": {}, "f:value": {}}},
        "f:ports": {PORT: {".": {}, "f:containerPort": {}}},
    }
}  # fmt: skip
OURS = update(US, {"f:replicas": {}, **pod({"f:containers": OWN, "f:nodeSelector": {}})}, operation="Apply")
OURS |= {"apiVersion": "apps/v1", "fieldsType": "FieldsV1"}
STATUS = {
    "manager": "k3s", "operation": "Update", "subresource": "status", "fieldsV1": {"f:status": {"f:replicas": {}}},
}  # fmt: skip


def shown(*entries: dict[str, Any], **spec: Any) -> dict[str, Any]:
    """The object with defaults, one more container and variable, and who owns what."""
    found = copy.deepcopy(WANTED)
    found["metadata"] |= {"managedFields": [OURS, STATUS, *entries], "resourceVersion": "7"}
    inner = found["spec"]["template"]["spec"]
    inner["dnsPolicy"] = "ClusterFirst"
    inner["containers"][0] |= {"env": [{"name": "A", "value": "1"}, {"name": "DEBUG", "value": "1"}]}
    inner["containers"][0]["ports"] = [{"containerPort": 80, "protocol": "TCP"}]
    inner["containers"].append({"name": "shell", "image": "busybox", "terminationMessagePath": "/dev/termination-log"})
    found["spec"] |= spec
    return found


VARIABLE = {EXTRA: {".": {}, "f:name": {}, "f:value": {}}}
BY_SET = update("kubectl-set", pod({"f:containers": {APP: {"f:image": {}, "f:env": VARIABLE}}}))
SHELL = {SIDECAR: {".": {}, "f:image": {}, "f:name": {}}}
BY_EDIT = update("kubectl-edit", {"f:paused": {}, **pod({"f:containers": SHELL})})
FOREIGN = {"f:spec": {"f:paused": {}, **pod({"f:containers": {APP: {"f:env": VARIABLE}, **SHELL}})}}


def test_what_we_name_the_server_fills_in_or_controllers_write_is_none_of_it() -> None:
    scaled = update("k3s", {"f:replicas": {}}, subresource="scale")
    image = update("kubectl-set", pod({"f:containers": {APP: {"f:image": {}, "f:ports": {PORT: {".": {}}}}}}))
    restarted = update("kubectl-rollout", {"f:template": {"f:metadata": {"f:annotations": {"f:restartedAt": {}}}}})
    assert foreign_fields(shown(scaled, image, restarted), WANTED, US) == {}


def test_a_mapping_that_is_one_field_has_to_be_the_wanted_one() -> None:
    selector = update("kubectl-edit", pod({"f:nodeSelector": {}}))
    found = shown(selector)
    assert foreign_fields(found, WANTED, US) == {}
    found["spec"]["template"]["spec"]["nodeSelector"]["disk"] = "ssd"
    assert foreign_fields(found, WANTED, US) == {"f:spec": pod({"f:nodeSelector": {}})}


def test_what_others_put_beside_ours_is_taken_over_as_if_we_had_applied_it() -> None:
    found = shown(BY_SET, BY_EDIT, paused=True)
    assert foreign_fields(found, WANTED, US) == FOREIGN
    taken = taken_over(found, FOREIGN, US)
    assert [entry["manager"] for entry in taken] == [US, "k3s", "kubectl-set"]  # of kubectl-edit nothing is left
    assert taken[2]["fieldsV1"] == {"f:spec": pod({"f:containers": {APP: {"f:image": {}}}})}
    now = {**found, "metadata": {**found["metadata"], "managedFields": taken}}
    part = applied_part(now, US)
    assert part is not None
    assert part["spec"]["paused"] is True
    assert [one["name"] for one in part["spec"]["template"]["spec"]["containers"]] == ["app", "shell"]
    assert foreign_fields(now, WANTED, US) == {}
    assert left_fields(now, WANTED, US) == FOREIGN  # a run that ends here leaves it to be seen
    assert left_fields(found, WANTED, US) == {}


def test_an_entry_that_is_one_field_is_there_as_a_whole() -> None:
    """As the API server has the pull secrets of a pod, which the version to go back to needs."""
    pulls = pod({"f:imagePullSecrets": {'k:{"name":"pull"}': {}}})
    entry = {"manager": US, "operation": "Apply", "fieldsV1": {"f:spec": pulls}}
    spec = {"template": {"spec": {"imagePullSecrets": [{"name": "pull"}, {"name": "theirs"}]}}}
    part = applied_part({**shown(), "spec": spec, "metadata": {"name": "a", "managedFields": [entry]}}, US)
    assert part is not None
    assert part["spec"] == {"template": {"spec": {"imagePullSecrets": [{"name": "pull"}]}}}


def test_what_was_never_applied_is_taken_over_too() -> None:
    """An object that somebody made anew out of a copy: the defaults are his, too."""
    copied = update("velero", {"f:replicas": {}, "f:paused": {}, "f:progressDeadlineSeconds": {}})
    found = {**shown(copied), "metadata": {"name": "a", "namespace": "r", "managedFields": [copied]}}
    foreign = foreign_fields(found, WANTED, US)
    assert foreign == {"f:spec": {"f:paused": {}, "f:progressDeadlineSeconds": {}}}
    own, rest = taken_over(found, foreign, US)
    assert (own["manager"], own["operation"], own["apiVersion"]) == (US, "Apply", "apps/v1")
    assert (own["fieldsV1"], rest["fieldsV1"]) == (foreign, {"f:spec": {"f:replicas": {}}})


def test_without_them_it_is_what_it_was() -> None:
    left = without_fields(shown(BY_SET, BY_EDIT, paused=True), FOREIGN)
    assert "paused" not in left["spec"]
    assert left["spec"]["template"]["spec"]["containers"] == [
        {**WANTED["spec"]["template"]["spec"]["containers"][0], "ports": [{"containerPort": 80, "protocol": "TCP"}]}
    ]
    assert left["spec"]["template"]["spec"]["dnsPolicy"] == "ClusterFirst"
