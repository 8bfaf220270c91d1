# SPDX-License-Identifier: GPL-3.0-or-later
"""Requests and writes, against an API server in this process."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube import connection
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.cache import Ref
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.client import Kube
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.connection import PATIENCE, ApiError
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._kube.kube_objects import obj
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._kube.kube_server import (
    SERVICE_ADDRESS,
    Clock,
    Server,
)

NAMESPACES = "/api/v1/namespaces"
MAPS = f"{NAMESPACES}/robot-robot1/configmaps"
DEPLOYMENTS = "/apis/apps/v1/namespaces/robot-robot1/deployments"


def config_map(name: str, **data: str) -> dict[str, Any]:
    metadata = {"name": name, "namespace": "robot-robot1", "labels": {"a": "b"}}
    return {"apiVersion": "v1", "kind": "ConfigMap", "metadata": metadata, "data": data}


DEPLOYMENT = {**config_map("app"), "apiVersion": "apps/v1", "kind": "Deployment", "spec": {"replicas": 1}}
NAMESPACE = {"apiVersion": "v1", "kind": "Namespace", "metadata": {"name": "robot-robot1"}}


# --- requests -------------------------------------------------------------------------------------------------------


def test_lists_with_selectors_and_impersonation(server: Server, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("K8S_AUTH_IMPERSONATE_USER", "u")
    server.lists[DEPLOYMENTS] = [obj("Deployment", "a"), obj("Deployment", "b")]
    with Kube({"host": server.url, "api_key": "t\n"}) as kube:  # as a file has it
        assert kube.objects("Deployment", "robot-robot1", labels="a=b") == server.lists[DEPLOYMENTS]
    path, query, headers = server.seen()
    assert (path, query) == (DEPLOYMENTS, {"labelSelector": "a=b"})
    assert (headers["authorization"], headers["impersonate-user"]) == ("Bearer t", "u")


@pytest.mark.parametrize(("status", "words", "transient"), [
    (422, "that field cannot be changed", False), (401, "refuses the credentials", False),
    (404, "Is that address a Kubernetes API", False), (429, "slow down", True),
    (503, "slow down", True),
])  # fmt: skip
def test_refusals(server: Server, kube: Kube, status: int, words: str, transient: bool) -> None:
    server.refusals += [(status, "slow down")] * (50 if transient else 1)
    with pytest.raises(ApiError, match=words) as error:
        kube.objects("Node")
    assert server.url in str(error.value)
    assert "secret-token" not in str(error.value)
    assert (error.value.status, error.value.transient) == (status, transient)
    assert ("It was tried" in str(error.value)) is transient


@pytest.mark.parametrize(("why", "told"), [
    ('nodes is forbidden: User "u" cannot list resource "nodes"', '"nodes". These credentials lack that permission.'),
    ("unable to create new content in namespace a because it is being terminated", "is being terminated."),
])  # fmt: skip
def test_who_is_refused_for_other_reasons_than_rights_is_not_told_to_lack_them(
    server: Server, kube: Kube, why: str, told: str
) -> None:
    server.refusals += [(403, why)]
    with pytest.raises(ApiError) as error:
        kube.objects("Node")
    assert str(error.value).endswith(told)


def test_a_token_that_no_header_has_is_not_repeated(server: Server) -> None:
    with Kube({"host": server.url, "api_key": "my\nsecret"}) as kube, pytest.raises(ApiError) as error:
        kube.get(Ref("Node", "a", "", "v1"))
    assert "The credentials from the task's options" in str(error.value) and "secret" not in str(error.value)


def test_nothing_listens() -> None:
    url = f"http://{SERVICE_ADDRESS}:1"
    with Kube({"host": url, "api_key": "t"}, patience=0) as kube, pytest.raises(ApiError) as error:
        kube.objects("Node")
    assert str(error.value).startswith(f"The Kubernetes API at {url} cannot be reached: connection refused. Check that")
    assert error.value.transient
    proxied = {"host": "https://192.0.2.1:6443", "api_key": "t", "proxy": f"http://me:secret@{SERVICE_ADDRESS}:1"}
    with Kube(proxied, patience=0) as kube, pytest.raises(ApiError) as error:
        kube.objects("Node")
    said = str(error.value)
    assert f"192.0.2.1:6443 cannot be reached: by the proxy {SERVICE_ADDRESS}:1: connection refused" in said
    assert "secret" not in said


# --- patience -------------------------------------------------------------------------------------------------------


def test_patience_has_an_end_that_says_what_was_seen(server: Server, kube: Kube, clock: Clock, said: list[str]) -> None:
    server.refusals += [(503, "etcd has no leader"), *[(503, "starting")] * 20]
    with pytest.raises(ApiError, match=r"503 .*starting.* tried \d times in 4 s; before: .*no leader") as error:
        kube.within(4).objects("Node")
    assert clock.time == pytest.approx(4)
    assert error.value.transient and not said  # nobody is told of what is over by then


def test_a_server_that_restarts_is_waited_for_and_told_about(
    server: Server, kube: Kube, clock: Clock, said: list[str]
) -> None:
    server.write_refusals += [(429, "slow down"), (500, "oh"), *[(503, "starting")] * 18]
    assert [one.changed for one in kube.apply([NAMESPACE])] == [True]
    assert 30 < clock.time < PATIENCE
    assert len(said) == 2
    assert "503 for PATCH /api/v1/namespaces/robot-robot1: starting. It is tried again for 5" in said[0]


# --- writes ---------------------------------------------------------------------------------------------------------


def test_apply_creates_changes_and_then_changes_nothing(server: Server, kube: Kube) -> None:
    wanted = [NAMESPACE, config_map("one", k="v")]
    first = kube.apply(wanted)
    assert server.writes[0] == f"PATCH {NAMESPACES}/robot-robot1"
    assert server.owned[(f"{NAMESPACES}/robot-robot1", "rosops.fleet")] == NAMESPACE
    assert [str(one.ref) for one in first] == ["Namespace robot-robot1", "ConfigMap robot-robot1/one"]
    assert (first[1].before, first[1].after, first[1].changed) == (None, config_map("one", k="v"), True)
    assert [one.changed for one in kube.apply(wanted)] == [False, False]
    (second,) = kube.apply([config_map("one", other="v")])
    assert (second.before, second.after) == (config_map("one", k="v"), config_map("one", other="v"))


def test_many_of_a_kind_are_looked_up_by_one_list(server: Server, kube: Kube) -> None:
    maps = [config_map(name) for name in "abc"]
    kube.apply([NAMESPACE, *maps])
    server.requests.queue.clear()
    assert not any(one.changed for one in kube.apply([NAMESPACE, *maps]))
    assert [path for path, _query, _headers in server.requests.queue] == [MAPS, f"{NAMESPACES}/robot-robot1"]


def test_a_dry_run_writes_nothing_and_says_what_would_be(server: Server, kube: Kube) -> None:
    kube.apply([NAMESPACE])
    before = json.dumps(server.lists, sort_keys=True)
    new, same = kube.apply([config_map("one", k="v"), NAMESPACE], dry_run=True)
    assert (new.before, new.changed, same.changed) == (None, True, False)
    assert json.dumps(server.lists, sort_keys=True) == before


def test_a_dry_run_in_a_namespace_to_come(server: Server, kube: Kube) -> None:
    applied = kube.apply([NAMESPACE, *(config_map(name, k="v") for name in "abc")], dry_run=True)
    assert [one.changed for one in applied] == [True] * 4
    assert applied[1].after == config_map("a", k="v")
    assert not server.lists.get(NAMESPACES)
    with pytest.raises(ApiError, match="namespace has to be applied first") as error:
        kube.apply([config_map("a")])
    assert error.value.status == 404


def test_an_error_says_what_was_written_before_it(server: Server, kube: Kube) -> None:
    lost = {**config_map("x"), "metadata": {"name": "x", "namespace": "nowhere"}}
    with pytest.raises(ApiError) as error:
        kube.apply([NAMESPACE, lost, config_map("never")])
    assert error.value.details == {"applied": ["Namespace robot-robot1"]}
    assert not server.lists.get(MAPS)


def test_a_deployment_is_written_as_it_was_looked_at(
    server: Server, kube: Kube, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Who writes it between the look and the write is not passed over: that may be the run that has the Lease now."""
    kube.apply([NAMESPACE, DEPLOYMENT])
    looks: list[Ref] = []

    def get(ref: Ref) -> Any:
        found = Kube.get(kube, ref)
        if ref.kind == "Deployment" and not looks:
            server.put(f"{DEPLOYMENTS}/app", {**(found or {}), "spec": {"replicas": 5}})
        looks.append(ref)
        return found

    monkeypatch.setattr(kube, "get", get)
    server.writes.clear()
    kube.apply([DEPLOYMENT])
    assert server.writes == [f"PATCH {DEPLOYMENTS}/app"] * 2
    assert server.find(f"{DEPLOYMENTS}/app")["spec"] == {"replicas": 1}


POLICY = {
    "apiVersion": "admissionregistration.k8s.io/v1", "kind": "ValidatingAdmissionPolicy",
    "metadata": {"name": "keepers"}, "spec": {"validations": [{"expression": "true"}]},
}  # fmt: skip
POLICIES = "/apis/admissionregistration.k8s.io/v1/validatingadmissionpolicies"


def test_what_is_the_cluster_s_is_written_only_where_it_is_not_as_it_should_be(server: Server, kube: Kube) -> None:
    assert [one.changed for one in kube.apply([POLICY])] == [True]
    filled = {"failurePolicy": "Fail", **POLICY["spec"]}  # by the API server
    server.put(f"{POLICIES}/keepers", {**POLICY, "spec": filled})
    server.writes.clear()
    assert [one.changed for one in kube.apply([POLICY])] == [False]
    assert not server.writes
    server.put(f"{POLICIES}/keepers", {**POLICY, "spec": {**filled, "validations": []}})
    assert [one.changed for one in kube.apply([POLICY], dry_run=True)] == [True]


def test_a_condition_that_somebody_put_beside_those_of_a_policy_goes(server: Server, kube: Kube) -> None:
    mine, theirs = ({"name": name, "expression": name} for name in ("keepers", "false"))
    wanted = {**POLICY, "spec": {"matchConditions": [mine]}}
    beside = {"f:spec": {"f:matchConditions": {'k:{"name":"false"}': {".": {}, "f:name": {}, "f:expression": {}}}}}
    fields = [{"manager": "kubectl-edit", "operation": "Update", "fieldsV1": beside}]
    there = {"metadata": {**POLICY["metadata"], "managedFields": fields}, "spec": {"matchConditions": [mine, theirs]}}
    server.put(f"{POLICIES}/keepers", {**POLICY, **there})
    assert [one.changed for one in kube.apply([wanted], dry_run=True)] == [True]
    kube.apply([wanted])
    (entry,) = server.find(f"{POLICIES}/keepers")["metadata"]["managedFields"]
    assert (entry["manager"], entry["fieldsV1"]) == ("rosops.fleet", beside)  # what we have and do not apply goes


def test_an_account_that_somebody_put_beside_ours_loses_our_rights(server: Server, kube: Kube) -> None:
    ours, theirs = ({"kind": "ServiceAccount", "name": name, "namespace": "kube-system"} for name in ("a", "b"))
    metadata, kind = {"name": "keepers"}, "ClusterRoleBinding"
    wanted = {"apiVersion": "rbac.authorization.k8s.io/v1", "kind": kind, "metadata": metadata, "subjects": [ours]}
    there = f"/apis/rbac.authorization.k8s.io/v1/{kind.lower()}s/keepers"
    server.put(there, {**wanted, "subjects": [ours, theirs]})
    assert [one.changed for one in kube.apply([wanted])] == [True]
    assert server.find(there)["subjects"] == [ours]
    assert [one.changed for one in kube.apply([wanted])] == [False]


@pytest.mark.parametrize("reads", [True, False])
def test_who_may_not_write_it_is_told_who_may(server: Server, kube: Kube, reads: bool) -> None:
    (server.write_refusals if reads else server.refusals).append((403, "forbidden"))
    with pytest.raises(ApiError, match=r"Run rosops\.fleet\.awx_access and then rosops\.fleet\.site with ") as error:
        kube.apply([POLICY])
    assert error.value.status == 403
    assert not server.lists.get(POLICIES)


@pytest.mark.parametrize("dry_run", [True, False])
def test_an_api_that_is_too_old_for_it_is_told_what_is_the_oldest(server: Server, kube: Kube, dry_run: bool) -> None:
    server.write_refusals.append((404, "page not found"))
    with pytest.raises(ApiError, match=rf"PATCH {POLICIES}/keepers: page not found\. Is that .* API, 1\.30 or newer"):
        kube.apply([POLICY, NAMESPACE], dry_run)
    assert len(server.writes) == 1


PAUSED = {"manager": "kubectl-rollout", "operation": "Update", "fieldsV1": {"f:spec": {"f:paused": {}}}}


def paused(server: Server) -> None:
    """A Deployment that somebody paused."""
    server.put(f"{NAMESPACES}/robot-robot1", NAMESPACE)
    spec, metadata = {"replicas": 1, "paused": True}, {**config_map("app")["metadata"], "managedFields": [PAUSED]}
    server.put(f"{DEPLOYMENTS}/app", {**DEPLOYMENT, "spec": spec, "metadata": metadata})


def test_what_others_put_beside_ours_is_taken_over_before_we_apply(server: Server, kube: Kube) -> None:
    paused(server)
    server.write_refusals += [(409, "the object has been modified")]  # as its status is written all the time
    kube.apply([DEPLOYMENT])
    assert server.writes == [f"PATCH {DEPLOYMENTS}/app"] * 3
    (entry,) = server.find(f"{DEPLOYMENTS}/app")["metadata"]["managedFields"]
    assert (entry["manager"], entry["operation"]) == ("rosops.fleet", "Apply")
    assert entry["fieldsV1"] == PAUSED["fieldsV1"]


def test_a_dry_run_foresees_that_it_goes_and_takes_nothing_over(server: Server, kube: Kube) -> None:
    paused(server)
    (change,) = kube.apply([DEPLOYMENT], dry_run=True)
    assert change.changed and (change.after or {})["spec"] == {"replicas": 1}
    assert server.find(f"{DEPLOYMENTS}/app")["metadata"]["managedFields"] == [PAUSED]


def test_of_other_kinds_what_others_put_there_stays(server: Server, kube: Kube) -> None:
    server.put(f"{NAMESPACES}/robot-robot1", NAMESPACE)
    api, path = "networking.k8s.io/v1", "/apis/networking.k8s.io/v1/namespaces/robot-robot1/networkpolicies/notes"
    wanted = {**config_map("notes"), "apiVersion": api, "kind": "NetworkPolicy", "spec": {"ours": "1"}}
    beside = {"manager": "kubectl-edit", "operation": "Update", "fieldsV1": {"f:spec": {"f:theirs": {}}}}
    both = {"ours": "1", "theirs": "2"}
    server.put(path, {**wanted, "spec": both, "metadata": {**wanted["metadata"], "managedFields": [beside]}})
    assert [one.changed for one in kube.apply([wanted])] == [False]
    assert (server.find(path)["spec"], server.find(path)["metadata"]["managedFields"]) == (both, [beside])


def test_the_log_of_a_message(server: Server, kube: Kube, clock: Clock) -> None:
    pod = "/api/v1/namespaces/robot-robot1/pods/a"
    server.put(f"{pod}/log", {})
    kube.log_tail("robot-robot1", "a", "main", 3, previous=False)
    kube.log_tail("robot-robot1", "a", "main")
    asked = {"container": "main", "tailLines": "3", "previous": "false"}
    seen = [server.seen()[:2] for _time in range(2)]
    assert seen == [(f"{pod}/log", asked), (f"{pod}/log", {**asked, "tailLines": "5", "previous": "true"})]
    server.refuse = lambda _path: 502  # the kubelet of a robot that is off
    with pytest.raises(ApiError):
        kube.log_tail("robot-robot1", "p", "app")
    assert clock.time == 0  # a message is not worth a wait


def test_delete(server: Server, kube: Kube) -> None:
    kube.apply([NAMESPACE, config_map("one")])
    ref = Ref("ConfigMap", "one", "robot-robot1", "v1")
    assert [(one.changed, one.after) for one in kube.delete([ref], dry_run=True)] == [(True, None)]
    assert not kube.delete([replace(ref, uid="uid-of-a-namesake")])[0].changed
    assert kube.get(ref) is not None
    server.put(f"{NAMESPACES}/robot-robot1/configmaps/held", {"metadata": {"name": "held", "deletionTimestamp": "t"}})
    assert not kube.delete([replace(ref, name="held")])[0].changed  # by somebody's finalizer
    again = [ref, Ref("ConfigMap", "two", "robot-robot1")]
    assert [one.changed for one in kube.delete(again, at_once=True)] == [True, False]
    assert kube.get(ref) is None
    options = {"kind": "DeleteOptions", "apiVersion": "v1", "propagationPolicy": "Background"}
    named = {"preconditions": {"uid": "uid-of-a-namesake"}}
    added: list[dict[str, Any]] = [{"dryRun": ["All"]}, named, {"gracePeriodSeconds": 0}]
    assert server.deletions == [{**options, **one} for one in added]


def test_merge(server: Server, kube: Kube) -> None:
    server.lists["/api/v1/nodes"] = [{"metadata": {"name": "robot1", "resourceVersion": "7", "labels": {"a": "b"}}}]
    node = Ref("Node", "robot1")
    assert kube.merge(node, {"metadata": {"labels": {"c": "d"}}}, dry_run=True).changed
    written = kube.merge(node, {"metadata": {"labels": {"a": None, "c": "d"}, "resourceVersion": "7"}})
    assert written.after == {"metadata": {"name": "robot1", "labels": {"c": "d"}}}
    with pytest.raises(ApiError, match="Somebody else changed it") as error:
        kube.merge(node, {"metadata": {"labels": {"x": "y"}, "resourceVersion": "7"}})
    assert error.value.status == 409


def test_an_answer_without_end_is_not_read(server: Server, kube: Kube, monkeypatch: pytest.MonkeyPatch) -> None:
    """A robot that is a cluster of its own may answer what it wants."""
    server.lists["/api/v1/nodes"] = [{"metadata": {"name": "x" * 5000, "resourceVersion": "7"}}]
    assert kube.objects("Node")
    monkeypatch.setattr(connection, "MAX_ANSWER", 4000)
    with pytest.raises(ApiError, match="more than 4000 bytes was not read"):
        kube.objects("Node")
