# SPDX-License-Identifier: GPL-3.0-or-later
"""Changes that come by other doors than a run's: what `kubectl`, a tool of another kind, or a hand at night does.

Apps that overlap lose nothing. The next run changes nothing of what was only begun anew, and puts the rest right.
"""

from __future__ import annotations

import base64
import json
import re
from collections.abc import Sequence

import pytest
from cluster import Pod
from fleet import LIMIT, Fleet
from runs import wait_until

PUBLISHER, SUBSCRIBER, SERVICE = "temperature", "temperature-stats", "add-two-ints"
DRAINED = "prime-factors"
SECONDS = 180  # for pods to come and go on a busy machine


def kubectl(fleet: Fleet, command: str, namespace: str = "-n robot-robot1") -> str:
    return fleet.hosts.ssh("edge1", f"k3s kubectl {namespace} {command}")


def deployments(apps: Sequence[str]) -> str:
    return " ".join(f"deployment/{app}" for app in apps)


def replaced(fleet: Fleet, apps: Sequence[str], before: dict[str, list[Pod]]) -> None:
    """Until each has one pod, ready, which is none of those before. A mark that an undo brings back says nothing."""

    def still() -> list[str]:
        now = fleet.cluster.pods("robot1")
        found = {
            app: [(pod.ready, pod.going, pod.uid == before[app][0].uid) for pod in now.get(app, [])] for app in apps
        }
        return [f"{app}: {seen}" for app, seen in found.items() if seen != [(True, False, False)]]

    wait_until(still, lambda left: not left, SECONDS, f"other pods of {', '.join(apps)}")


def assert_alone(fleet: Fleet, apps: Sequence[str]) -> None:
    """`assert_own_nodes`, and none of their containers ended."""
    assert_own_nodes(fleet, apps)
    pods = fleet.pods()["robot1"]
    ended = {app: fleet.cluster.last_words("robot1", app) for app in apps if any(pod.ended for pod in pods[app])}
    assert not ended, ended


def assert_own_nodes(fleet: Fleet, apps: Sequence[str]) -> None:
    """On the graph each has the node of its pod, and no other version's."""
    pods = fleet.pods()["robot1"]
    nodes = fleet.cluster.ros_nodes("robot1", pods["add-two-ints-client"][0].name)
    for app in apps:
        name, (pod,) = app.replace("-", "_"), pods[app]
        own = [node for node in nodes if re.fullmatch(rf"/{name}(_[0-9a-f]{{8}}(_\w+)?)?", node)]
        assert own == [f"/{name}_{pod.version}"], nodes


def unchanged(fleet: Fleet) -> None:
    before = fleet.running()
    fleet.update(fleet.variables, *LIMIT).must(0, robot1="unchanged").must_change_nothing()
    fleet.assert_still_running(before)


def put_right(fleet: Fleet, app: str) -> None:
    """The next run goes through the gate."""
    run = fleet.update(fleet.variables, *LIMIT).must(0, robot1="updated")
    (step,) = run.steps("robot1")
    assert step["name"] == app and "gate" in step["phases"], run
    fleet.wait_settled()
    assert_alone(fleet, [app])


RESTARTS = pytest.mark.promise("kubectl rollout restart of apps that overlap loses nothing, and is no change")


@pytest.mark.parametrize(
    "apps",
    [[PUBLISHER], [SUBSCRIBER], pytest.param([PUBLISHER, SUBSCRIBER], marks=RESTARTS), [SERVICE]],
    ids="+".join,
)
def test_rollout_restart(fleet: Fleet, apps: list[str]) -> None:
    before, watch = fleet.pods()["robot1"], fleet.watch()
    for _time in range(2):
        known = fleet.pods()["robot1"]
        kubectl(fleet, f"rollout restart {deployments(apps)}")
        replaced(fleet, apps, known)
    fleet.wait_settled()
    assert_alone(fleet, apps)
    after = fleet.pods()["robot1"]
    assert {app: after[app][0].revision for app in apps} == {app: before[app][0].revision for app in apps}
    assert {app for app in after if [pod.uid for pod in after[app]] != [pod.uid for pod in before[app]]} == {*apps}
    watch.assert_nothing_lost("robot1")
    unchanged(fleet)


@pytest.mark.parametrize("app", [PUBLISHER, SUBSCRIBER, SERVICE])
def test_set_image(fleet: Fleet, app: str) -> None:
    """The same image by another name: the template is another one, and what our hashes say of it is as before."""
    before, watch = fleet.pods()["robot1"], fleet.watch()
    kubectl(fleet, f"set image deployment/{app} ros-app=docker.io/{before[app][0].image}")
    replaced(fleet, [app], before)
    assert_alone(fleet, [app])
    watch.assert_nothing_lost("robot1")
    put_right(fleet, app)
    watch.assert_nothing_lost("robot1")


def test_a_version_by_hand_that_never_connects_takes_nobody_s_place(fleet: Fleet) -> None:
    """Its pod is never ready, and says why; the one at work stays."""
    before, watch = fleet.pods()["robot1"], fleet.watch()
    kubectl(fleet, f"set env deployment/{PUBLISHER} NEVER_CONNECT=true")
    wait_until(lambda: fleet.cluster.pods("robot1")[PUBLISHER], lambda pods: len(pods) == 2, SECONDS, "a second pod")

    def new() -> Pod:
        return next(pod for pod in fleet.cluster.pods("robot1")[PUBLISHER] if pod.uid != before[PUBLISHER][0].uid)

    lacks = "lives, but does not publish it"
    said = wait_until(new, lambda pod: lacks in pod.gate, SECONDS, "why it is not ready", pause=2)
    assert not said.ready
    watch.assert_nothing_lost("robot1")
    put_right(fleet, PUBLISHER)
    watch.assert_nothing_lost("robot1")


@pytest.mark.parametrize("app", [PUBLISHER, SERVICE])
def test_rollout_undo(fleet: Fleet, app: str) -> None:
    """To the version before, with the mark that it had then."""
    older = fleet.pods()["robot1"][app][0]
    fleet.update(fleet.new_version("robot1", app), *LIMIT, update_soak=0).must(0, robot1="updated")
    before, watch = fleet.pods()["robot1"], fleet.watch()
    kubectl(fleet, f"rollout undo deployment/{app}")
    replaced(fleet, [app], before)
    (now,) = fleet.pods()["robot1"][app]
    assert now.version == older.version
    assert_alone(fleet, [app])
    watch.assert_nothing_lost("robot1")
    put_right(fleet, app)
    watch.assert_nothing_lost("robot1")


def test_a_manifest_that_another_tool_applies(fleet: Fleet) -> None:
    """As Argo CD or Flux would, by server-side apply, taking the field from us."""
    before, watch = fleet.pods()["robot1"], fleet.watch()
    container = {"name": "ros-app", "image": f"docker.io/{before[PUBLISHER][0].image}"}
    manifest = {
        "apiVersion": "apps/v1", "kind": "Deployment", "metadata": {"name": PUBLISHER},
        "spec": {"template": {"spec": {"containers": [container]}}},
    }  # fmt: skip
    text = base64.b64encode(json.dumps(manifest).encode()).decode()
    apply = "apply --server-side --force-conflicts --field-manager=argocd -f -"
    fleet.hosts.ssh("edge1", f"echo {text} | base64 -d | k3s kubectl -n robot-robot1 {apply}")
    replaced(fleet, [PUBLISHER], before)
    assert_alone(fleet, [PUBLISHER])
    watch.assert_nothing_lost("robot1")
    put_right(fleet, PUBLISHER)
    watch.assert_nothing_lost("robot1")
    unchanged(fleet)


def test_scale_to_none_and_back(fleet: Fleet) -> None:
    """Whoever wants none has none meanwhile. The old one ends cleanly, and nobody else feels it."""
    apps = [PUBLISHER, DRAINED]
    watch = fleet.watch()
    kubectl(fleet, f"scale {deployments(apps)} --replicas=0")
    wait_until(
        lambda: [pod for app in apps for pod in fleet.cluster.pods("robot1").get(app, [])],
        lambda left: not left, SECONDS, "no pod",
    )  # fmt: skip
    (asked,) = fleet.pods()["robot1"]["add-two-ints-client"]
    nodes = fleet.cluster.ros_nodes("robot1", asked.name)
    left = [node for node in nodes if re.match(r"/(temperature_[0-9a-f]{8}|prime_factors\Z)", node)]
    assert left == [], "what ended has left the graph"
    kubectl(fleet, f"scale {deployments(apps)} --replicas=1")
    fleet.wait_settled(SECONDS)
    assert_alone(fleet, [PUBLISHER])
    (losses,) = watch.losses("robot1").values()
    assert (losses.failed, losses.unsuccessful, losses.twice) == ([], [], []), losses  # held goals came late
    unchanged(fleet)


def test_a_drain_of_the_robot_s_node_moves_nothing_and_all_comes_back(fleet: Fleet) -> None:
    """Apps that are local have no other place. They end cleanly, are away, and come back by themselves.

    So do the master and its keeper, which then know nothing of nodes that run elsewhere: those are begun anew.
    """
    before = fleet.pods()["robot1"]
    try:  # it asks for all evictions first; a pod that has a goal ends when that has
        options = "--ignore-daemonsets --delete-emptydir-data --force --timeout=20s"
        kubectl(fleet, f"drain robot1 {options} || true", namespace="")

        def working() -> list[str]:
            pods = fleet.cluster.pods("robot1")
            return [app for app in (PUBLISHER, SERVICE, DRAINED) for pod in pods[app] if pod.ready or pod.going]

        wait_until(working, lambda apps: not apps, SECONDS, "local apps that have ended")
        pods = fleet.cluster.pods("robot1")
        assert [pod.uid for pod in pods[SUBSCRIBER]] == [pod.uid for pod in before[SUBSCRIBER]]
    finally:
        kubectl(fleet, "uncordon robot1", namespace="")
    fleet.wait_settled(2 * SECONDS)
    assert_alone(fleet, [PUBLISHER, SERVICE])
    there = fleet.pods()["robot1"]
    elsewhere = [app for app in there if [pod.uid for pod in there[app]] == [pod.uid for pod in before[app]]]
    kubectl(fleet, f"rollout restart {deployments(elsewhere)}")
    replaced(fleet, elsewhere, there)
    fleet.wait_settled()
    watch = fleet.watch()
    assert_alone(fleet, [PUBLISHER, SUBSCRIBER, SERVICE])
    unchanged(fleet)
    watch.assert_nothing_lost("robot1")
