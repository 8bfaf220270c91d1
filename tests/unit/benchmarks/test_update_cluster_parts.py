# SPDX-License-Identifier: GPL-3.0-or-later
"""Manifests, inventory, rollouts, usage and stress of the experiment: what is decided without a cluster."""

from __future__ import annotations

from typing import Any

import pytest
from update.fleet_inventory import item, variables
from update.plain_manifests import NAMESPACE, app_deployment, base, node_name
from update.rollouts import restarts, unfinished
from update.scenario import CASES
from update.stress import LEAST, MEMORY, command, fill_bytes
from update.usage import usage
from update.windows import Span

MINOR = CASES[0]
APPS = [app for case in CASES for app in case.apps]


def test_every_pair_has_names_of_its_own() -> None:
    assert len({app.name for app in APPS}) == len(APPS)
    assert len({app.log_dir for app in APPS}) == len(APPS)
    topics = [case.source.topic for case in CASES if case.source.topic]
    assert len(set(topics)) == len(topics)


def test_an_update_changes_only_what_it_says() -> None:
    (changed,) = MINOR.changed()
    assert (changed.name, changed.tag) == ("minor-sub", "1.1")
    both = next(case for case in CASES if case.name == "pubsub/simultaneous")
    assert [app.tag for app in both.changed()] == ["1.1", "1.1"]
    assert [app.tag for app in both.apps] == ["1.0", "1.0"]
    service = next(case for case in CASES if case.name == "service/server")
    (server,) = service.changed()
    assert (server.tag, server.env["OPERATION"]) == ("1.0", "subtract")


def test_the_plain_arm_is_the_seeds_rolling_update() -> None:
    made = app_deployment(MINOR.sink, "robot1", "same")
    spec = made["spec"]
    container = spec["template"]["spec"]["containers"][0]
    assert made["metadata"]["namespace"] == NAMESPACE
    assert spec["strategy"] == {"type": "RollingUpdate", "rollingUpdate": {"maxSurge": 1, "maxUnavailable": 0}}
    assert container["readinessProbe"]["periodSeconds"] == 1
    assert "lifecycle" not in container
    assert "startupProbe" not in container
    assert container["args"] == ["temperature:=temperature_minor", "__name:=minor_sub"]


def test_node_names_of_the_plain_arm() -> None:
    (changed,) = MINOR.changed()
    assert node_name(MINOR.sink, "same") == node_name(changed, "same")
    assert node_name(MINOR.sink, "unique") != node_name(changed, "unique")
    for case in CASES:
        for before, after in zip([app for app in case.apps if app.name in case.changes], case.changed(), strict=True):
            assert node_name(before, "unique") != node_name(after, "unique")


def test_both_arms_run_the_same_programs_with_the_same_settings() -> None:
    for app in APPS:
        plain = app_deployment(app, "robot1", "same")["spec"]["template"]["spec"]["containers"][0]
        fleet = item(app)
        for key in ("image", "command", "resources"):
            assert plain[key] == fleet[key]
        env = {entry["name"]: entry.get("value") for entry in plain["env"]}
        assert fleet["env"].items() <= env.items()
        assert plain["args"][: len(app.remaps)] == fleet.get("args", [])


def test_masters_ask_for_the_same() -> None:
    objects = base("robot1", {"image": "lab/ros:noetic", "args": ["roscore"]})
    (plain,) = [found for found in objects if found["kind"] == "Deployment"]
    override = variables([])["ros_master_overrides"]["spec"]["template"]["spec"]["containers"][0]
    assert plain["spec"]["template"]["spec"]["containers"][0]["resources"] == override["resources"]


def deployment(**status: int) -> dict[str, Any]:
    whole = {"observedGeneration": 2, "updatedReplicas": 1, "readyReplicas": 1, "availableReplicas": 1, **status}
    return {
        "metadata": {"name": "a", "generation": 2},
        "spec": {"replicas": 1, "selector": {"matchLabels": {"app": "a"}}},
        "status": whole,
    }


def pod(name: str, restarted: int = 0) -> dict[str, Any]:
    return {
        "metadata": {"name": name, "labels": {"app": "a", "pod-template-hash": name}},
        "status": {"containerStatuses": [{"restartCount": restarted}]},
    }


@pytest.mark.parametrize(
    ("found", "pods", "complaint"),
    [
        ([deployment()], [pod("new")], ""),
        ([deployment()], [pod("new"), pod("old")], "2 pods"),  # the old one is still going
        ([deployment(observedGeneration=1)], [pod("old")], "not seen yet"),
        ([deployment(updatedReplicas=0)], [pod("old")], "updatedReplicas is 0"),
        ([deployment(availableReplicas=0)], [pod("new")], "availableReplicas is 0"),
        ([], [pod("new")], "no Deployment"),
    ],
)
def test_a_rollout_is_over_when_the_old_pod_is_gone(
    found: list[dict[str, Any]], pods: list[dict[str, Any]], complaint: str
) -> None:
    assert unfinished(found, pods, ["a"]) == (f"a: {complaint}" if complaint else "")


def test_restarts_are_named() -> None:
    assert restarts([pod("x"), pod("y", 2)]) == {"y": 2}


def test_usage_of_an_arm_leaves_out_other_pods_and_counts_new_ones() -> None:
    mib = 1024 * 1024
    old, new, dns = [5 * 10**9, 10 * mib], [250_000_000, 20 * mib], [0, 50 * mib]
    samples = [
        {"time": 10.0, "host": [0, 100 * mib], "pods": {"old": old, "dns": dns}},
        {"time": 11.0, "host": [10**9, 100 * mib], "pods": {"old": [5_500_000_000, 10 * mib], "new": new, "dns": dns}},
        {"time": 12.0, "host": [2 * 10**9, 100 * mib], "pods": {"new": [500_000_000, 20 * mib], "dns": [10**9, 0]}},
    ]
    found = usage({"robot1": samples}, Span(10.0, 13.0), {"dns"})
    assert found == {"pods_cpu": 50.0, "pods_mib": 20.0, "hosts_cpu": 100.0, "hosts_mib": 100.0}
    assert set(usage({"robot1": samples[:1]}, Span(10.0, 13.0), ()).values()) == {None}
    assert set(usage({}, Span(10.0, 13.0), ()).values()) == {None}


def test_stress_fills_the_hosts_memory_to_four_fifths() -> None:
    used = 700 * 1024**2
    assert fill_bytes(MEMORY, used) + used == MEMORY * 80 // 100
    assert fill_bytes(MEMORY, MEMORY) == LEAST
    words = command(2, 1024)
    assert words[words.index("--cpu") + 1] == "2"
    assert words[words.index("--cpu-load") + 1] == "80"
