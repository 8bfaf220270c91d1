# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Rollout verdicts: whole reasons, what the API leaves out, and namesakes in another namespace."""

from __future__ import annotations

import copy
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._step.objects import Object
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.cache import Ref, View
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.verdicts import judge, present_pods
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._kube.kube_objects import (
    NEW,
    OLD,
    conditions,
    controller_revision,
    daemon_set,
    deployment,
    obj,
    pod,
    ref,
    replica_set,
    set_pod,
    waiting,
)

DEPLOYMENT, DAEMON = ref("Deployment"), ref("DaemonSet")
SETS = [replica_set("talker-old", "1"), replica_set("talker-new", "2")]
DAEMON_PODS = [set_pod(f"talker-{number}", "new") for number in "ab"]
REVISIONS = [controller_revision("old", 1), controller_revision("new", 2)]


def reason(of: Ref, *objects: Object) -> tuple[str, str]:
    verdict = judge(of, View(list(objects)), (of,))
    return verdict.verdict, verdict.reason


def without(made: Object, *path: str) -> Object:
    """The object as the API shows it when a field was never set."""
    found = inner = copy.deepcopy(made)
    for key in path[:-1]:
        inner = inner[key]
    del inner[path[-1]]
    return found


def elsewhere(made: Object, **metadata: Any) -> Object:
    return {**made, "metadata": {**made["metadata"], "namespace": "robot-other", **metadata}}


@pytest.mark.parametrize(
    ("of", "objects", "spoiling"),
    [
        (DEPLOYMENT, [deployment(), *SETS, pod("talker-new-1", NEW)], [replica_set("talker-x", "9"), pod("x", OLD)]),
        (
            DAEMON,
            [daemon_set(), *REVISIONS, *DAEMON_PODS],
            [controller_revision("newest", 3), set_pod("x", "old")],
        ),
    ],
)
def test_namesakes_in_another_namespace_do_not_count(of: Ref, objects: list[Object], spoiling: list[Object]) -> None:
    alone = reason(of, *objects)
    assert alone[0] == "pass"
    assert reason(of, *objects, *map(elsewhere, spoiling)) == alone
    beside = present_pods(of, View([*objects, *map(elsewhere, objects[1:])]))
    assert beside == present_pods(of, View(objects))


NODE = obj("Node", "edge1", status={"conditions": conditions(Ready="True")})
NOT_READY: Object = {"type": "Ready", "status": "False", "reason": "KubeletNotReady", "message": "no network yet"}
FULL: Object = {"type": "DiskPressure", "status": "True", "message": "a full disk"}


@pytest.mark.parametrize(
    ("of", "objects", "verdict", "words"),
    [
        (DEPLOYMENT, [deployment(), *SETS, pod("talker-new-1", NEW)], "pass", "1 of 1 pods updated and available"),
        (
            DEPLOYMENT,
            [without(deployment(), "spec", "replicas"), *SETS, pod("talker-new-1", NEW)],
            "pass",
            "1 of 1 pods updated and available",
        ),
        (DAEMON, [daemon_set(), *REVISIONS, *DAEMON_PODS], "pass", "2 of 2 pods available"),
        (DAEMON, [daemon_set(), *DAEMON_PODS], "wait", "its controller revision has not been seen yet"),
        (DAEMON, [daemon_set(0), *REVISIONS], "pass", "no node wants it"),
        (ref("Node", "edge1"), [NODE], "pass", "Ready"),
        (ref("Node", "edge1"), [{**NODE, "spec": {"unschedulable": True}}], "pass", "Ready, cordoned"),
        (
            ref("Node", "edge1"),
            [{**NODE, "status": {"conditions": [NOT_READY]}}],
            "wait",
            "NotReady: KubeletNotReady: no network yet",
        ),
        (ref("Node", "edge1"), [{**NODE, "status": {"conditions": conditions(Ready="False")}}], "wait", "NotReady"),
        (
            ref("Node", "edge1"),
            [{**NODE, "status": {"conditions": [*conditions(Ready="True"), FULL]}}],
            "wait",
            "DiskPressure: a full disk",
        ),
    ],
)
def test_whole_reasons(of: Ref, objects: list[Object], verdict: str, words: str) -> None:
    assert reason(of, *objects) == (verdict, words)


def test_a_daemon_set_counts_what_is_unavailable() -> None:
    """numberAvailable may be that of the generation before."""
    made = daemon_set(status={"numberAvailable": 2, "numberUnavailable": 1})
    verdict, words = reason(DAEMON, made, *REVISIONS, *DAEMON_PODS)
    assert (verdict, words.startswith("1 of 2 pods")) == ("wait", True), words


@pytest.mark.parametrize(("count", "end"), [(1, ""), (2, " and 1 more"), (3, " and 2 more")])
def test_old_pods_are_counted(count: int, end: str) -> None:
    old = [pod(f"talker-old-{number}", OLD) for number in range(count)]
    verdict, words = reason(DEPLOYMENT, deployment(), *SETS, pod("talker-new-1", NEW), *old)
    assert verdict == "wait"
    assert words.partition(" more")[0].count("talker-old-") == 1, words
    assert (end in words) if end else (" more" not in words), words


@pytest.mark.parametrize(("count", "end"), [(3, ""), (4, "; and 1 more"), (6, "; and 3 more")])
def test_open_pods_are_named_up_to_three(count: int, end: str) -> None:
    pods = [pod(f"talker-new-{number}", NEW, [waiting("ContainerCreating")]) for number in range(count)]
    status = {"availableReplicas": 0, "unavailableReplicas": count}
    _verdict, words = reason(DEPLOYMENT, deployment(count, status=status), *SETS, *pods)
    assert words.count("talker-new-") == 3, words
    assert words.endswith(end) if end else " more" not in words, words
