# SPDX-License-Identifier: GPL-3.0-or-later
"""k3s is changed under robots at work: configuration, version, one that does not start, a run that is killed."""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Iterator
from typing import Any

import pytest
from cluster import LAB, Hosts
from fleet import ALL_AT_ONCE, LIMIT, ROBOTS, Fleet
from runs import Run

EDGE = "edge1"
HOSTS = [EDGE, *ROBOTS]
BINARY, RECORD = "/usr/local/bin/k3s", "/var/lib/rosops-fleet/k3s-change.json"
DATABASE = "/var/lib/rancher/k3s/server/db"
SYSCTLS, AUDIT_POLICY = "/etc/sysctl.d/90-rosops-fleet.conf", "/etc/rancher/k3s/rosops-fleet-audit.yaml"
AUDIT_LOG = "/var/lib/rancher/k3s/server/logs/audit.log"
SETTINGS: dict[str, Any] = {"kubelet-arg": ["max-pods=100"]}


def change(fleet: Fleet, *arguments: str, **variables: Any) -> Run:
    """`site.yml --tags k3s` with these variables on top of the fleet's."""
    return fleet.playbooks.run("site", {**fleet.variables, **variables}, "--tags", "k3s", *arguments)


def on(fleet: Fleet, command: str) -> dict[str, str]:
    """What a command prints on every host."""
    return {host: fleet.hosts.ssh(host, command).strip() for host in HOSTS}


def starts(fleet: Fleet) -> dict[str, str]:
    """When each host's k3s was started."""
    return on(fleet, "systemctl show k3s k3s-agent -p ExecMainStartTimestampMonotonic --value | tr '\\n' ' '")


def unproven(fleet: Fleet, host: str) -> bool:
    return bool(json.loads(fleet.hosts.ssh(host, f"cat {RECORD}"))["unproven"])


@pytest.fixture
def put_back(fleet: Fleet) -> Iterator[None]:
    """The hosts' k3s as it was, whatever the case did to it: there is no way down by the inventory."""
    before = on(fleet, f"{BINARY} --version")
    yield
    for host, text in before.items():
        if fleet.hosts.ssh(host, f"{BINARY} --version").strip() != text:
            unit = "k3s" if host == EDGE else "k3s-agent"
            fleet.hosts.ssh(
                host,
                f"systemctl stop {unit} && cp -p {BINARY}.previous {BINARY} && rm {RECORD} && systemctl start {unit}",
            )
    change(fleet, **ALL_AT_ONCE).must(0)
    fleet.wait_settled()


def test_k3s_is_light_beside_the_pods_of_a_robot(fleet: Fleet) -> None:
    found = on(fleet, "systemctl show k3s k3s-agent -p ActiveState -p CPUWeight -p ControlGroup")
    for host in HOSTS:
        unit = next(one for one in found[host].split("\n\n") if "ActiveState=active" in one)
        group, weight = ("/system.slice/k3s.service", "[not set]") if host == EDGE else ("/k3s-agent.service", "10")
        assert {f"ControlGroup={group}", f"CPUWeight={weight}"} <= {*unit.splitlines()}, found[host]


@pytest.mark.long
@pytest.mark.promise("k3s is changed under robots at work, and they notice nothing")
@pytest.mark.usefixtures("put_back")
def test_another_configuration_goes_from_the_server_to_the_robots(fleet: Fleet) -> None:
    before, pods = starts(fleet), fleet.running()
    watch = fleet.watch()
    run = change(fleet, k3s_config=SETTINGS, update_waves=[1, "100%"]).must(0)
    now = starts(fleet)
    assert all(now[host] != before[host] for host in HOSTS), run
    assert not any(unproven(fleet, host) for host in HOSTS)
    fleet.assert_still_running(pods)  # a restart of k3s is none of theirs
    watch.assert_only_lookups_failed()  # kube-proxy is a part of k3s


@pytest.mark.usefixtures("put_back")
def test_check_mode_and_a_second_run_start_no_k3s_anew(fleet: Fleet) -> None:
    before = starts(fleet)
    check = change(fleet, "--check", k3s_config=SETTINGS).must(0)
    assert check.output.count("idle now") + check.output.count("busy now") >= len(ROBOTS), check.output[-3000:]
    assert starts(fleet) == before
    change(fleet, k3s_config=SETTINGS, **ALL_AT_ONCE).must(0)
    now = starts(fleet)
    change(fleet, k3s_config=SETTINGS).must_change_nothing()
    assert starts(fleet) == now


@pytest.mark.long
@pytest.mark.promise("hardening comes and goes as a change of k3s, and the robots notice nothing")
@pytest.mark.usefixtures("put_back")
def test_hardening_comes_and_goes_under_robots_at_work(fleet: Fleet) -> None:
    before, pods = on(fleet, "cat /etc/rancher/k3s/config.yaml"), fleet.running()
    watch = fleet.watch()
    change(fleet, k3s_hardening=True, update_waves=[1, "100%"]).must(0)
    for host in HOSTS:
        path = f"/api/v1/nodes/{host}/proxy/configz"
        kubelet = json.loads(fleet.hosts.ssh(EDGE, f"{BINARY} kubectl get --raw {path}"))["kubeletconfig"]
        assert (kubelet["protectKernelDefaults"], kubelet["streamingConnectionIdleTimeout"]) == (True, "5m0s")
        fleet.hosts.ssh(host, f"test -e {SYSCTLS}")
    fleet.hosts.ssh(EDGE, f"{BINARY} kubectl -n kube-system create configmap audited --from-literal key=sought")
    fleet.hosts.ssh(EDGE, f"{BINARY} kubectl -n kube-system delete configmap audited")
    said = [json.loads(line) for line in fleet.hosts.ssh(EDGE, f"grep audited {AUDIT_LOG}").splitlines()]
    assert {"create", "delete"} <= {one["verb"] for one in said}
    assert {one["level"] for one in said} == {"Metadata"}
    assert not fleet.hosts.ssh(EDGE, f"grep sought {AUDIT_LOG} || true")
    change(fleet, k3s_hardening=True).must_change_nothing()
    change(fleet, update_waves=[1, "100%"]).must(0)
    assert on(fleet, "cat /etc/rancher/k3s/config.yaml") == before
    assert not any(on(fleet, f"ls {SYSCTLS} {AUDIT_POLICY} 2>/dev/null || true").values())
    fleet.assert_still_running(pods)
    watch.assert_only_lookups_failed()


@pytest.mark.long
@pytest.mark.promise("a k3s that does not start is taken back")
@pytest.mark.usefixtures("put_back")
def test_a_configuration_with_which_k3s_does_not_start_is_taken_back(fleet: Fleet) -> None:
    pods, config = fleet.running(), on(fleet, "cat /etc/rancher/k3s/config.yaml")
    bad = "{{ {'kubelet-arg': ['max-pods=none']} if inventory_hostname == 'robot1' else {} }}"
    run = change(fleet, k3s_config=bad).must(2)
    assert run.outcomes["robot1"] == "rolled-back", run
    assert on(fleet, "cat /etc/rancher/k3s/config.yaml") == config
    assert not unproven(fleet, "robot1")
    fleet.wait_settled()
    fleet.assert_still_running(pods)


@pytest.mark.usefixtures("put_back")
def test_what_a_killed_run_left_is_proven_by_the_next(fleet: Fleet) -> None:
    running = fleet.playbooks.start("site", {**fleet.variables, "k3s_config": SETTINGS}, "--tags", "k3s", "-v")
    running.wait_for(r"k3s: verify")
    running.kill()
    change(fleet, k3s_config=SETTINGS).must(0)
    assert not any(unproven(fleet, host) for host in HOSTS)


@pytest.fixture(scope="module", params=["SQLite", "etcd"])
def datastore(request: pytest.FixtureRequest, standing_fleet: Fleet) -> str:
    """That of the edge: SQLite, as a server that is alone has; then what `cluster-init` makes of it."""
    kind, fleet = str(request.param), standing_fleet
    fleet.settle()
    if kind == "etcd" and "etcd" not in fleet.hosts.ssh(EDGE, f"ls {DATABASE}").split():
        pods, watch = fleet.running(), fleet.watch()
        change(fleet, "--limit", EDGE, k3s_config={"cluster-init": True}).must(0)
        assert {"etcd", "state.db.migrated"} <= {*fleet.hosts.ssh(EDGE, f"ls {DATABASE}").split()}
        fleet.assert_still_running(pods)
        watch.assert_only_lookups_failed()
    # what has etcd keeps it, whatever the inventory says
    change(fleet).must_change_nothing()
    assert ("etcd" in fleet.hosts.ssh(EDGE, f"ls {DATABASE}").split()) is (kind == "etcd")
    return kind


def test_a_datastore_of_before_an_update_comes_back(fleet: Fleet) -> None:
    """What was marked and recorded then is no word on what is wanted now, and no app at work is taken for a new one."""
    kept = "/var/lib/rancher/kept-db"
    fleet.update(fleet.new_version("robot1", "temperature"), *LIMIT).must(0, robot1="updated")
    # its keeper watches it: the mark of that is in the copy
    fleet.hosts.ssh(EDGE, f"systemctl stop k3s && cp -a {DATABASE} {kept} && systemctl start k3s")
    there = fleet.variables
    fleet.wait_settled()
    fleet.update(fleet.new_version("robot1", "temperature"), *LIMIT).must(0, robot1="updated")
    fleet.hosts.ssh(EDGE, f"systemctl stop k3s && rm -r {DATABASE} && mv {kept} {DATABASE} && systemctl start k3s")
    for robot in ROBOTS:  # what a kubelet has seen since is newer than what the API has now: it would hear of nothing
        fleet.hosts.ssh(robot, "systemctl restart k3s-agent")
    fleet.variables = there
    fleet.wait_settled()

    before, watch = fleet.running(), fleet.watch()
    bad = fleet.new_version("robot1", "temperature", CRASH_AFTER=0.3)
    fleet.update(bad, *LIMIT, update_ready_timeout=30).must(2, robot1="rolled-back")
    fleet.assert_taken_back(before)
    good = fleet.update(fleet.new_version("robot1", "temperature"), *LIMIT).must(0, robot1="updated")
    (step,) = good.steps("robot1")
    assert {"gate", "record"} <= set(step["phases"]), good  # through the gate, and no installation
    watch.assert_nothing_lost("robot1", goals=False)


@pytest.fixture(scope="module")
def versions() -> dict[str, str]:
    """Airgap directories of versions to go to: `next`, and `minor`."""
    subprocess.run([str(LAB), "artifacts", "--next-k3s"], capture_output=True, check=True, timeout=1200)  # noqa: S603
    known = Hosts(os.environ.get("ROSOPS_LAB", "mol-update")).variables
    return {name: known[f"lab_{name}_airgap_dir"] for name in ("next", "minor")}


@pytest.mark.usefixtures("put_back")
def test_another_version_comes_and_the_one_before_is_refused(
    fleet: Fleet, datastore: str, versions: dict[str, str]
) -> None:
    before, pods = on(fleet, f"{BINARY} --version | head -1"), fleet.running()
    watch = fleet.watch()
    change(fleet, k3s_airgap_dir=versions["next"], update_waves=[1, "100%"]).must(0)
    now = on(fleet, f"{BINARY} --version | head -1")
    assert all(now[host] != before[host] for host in HOSTS), now
    assert on(fleet, f"{BINARY}.previous --version | head -1") == before
    kept = f"{DATABASE}/snapshots/rosops-before-*" if datastore == "etcd" else f"{DATABASE}.previous/state.db"
    fleet.hosts.ssh(EDGE, f"ls -d {kept}")
    fleet.assert_still_running(pods)
    watch.assert_nothing_lost()

    down = change(fleet).must(2)
    assert "is older than" in down.host("robot1")["reason"], down
    assert on(fleet, f"{BINARY} --version | head -1") == now


@pytest.fixture
def cgroup_v1_allowed(fleet: Fleet) -> Iterator[None]:
    """A kubelet from 1.35 on does not start on hosts with cgroup v1, as the lab's are, unless a file says so."""
    directory = "/var/lib/rancher/k3s/agent/etc/kubelet.conf.d"
    text = "apiVersion: kubelet.config.k8s.io/v1beta1\nkind: KubeletConfiguration\nfailCgroupV1: false\n"
    on(fleet, f"mkdir -p {directory} && printf '{text}' > {directory}/10-cgroup-v1.conf")
    yield
    on(fleet, f"rm {directory}/10-cgroup-v1.conf")


@pytest.mark.usefixtures("put_back", "cgroup_v1_allowed")
def test_a_minor_version_that_does_not_start_is_taken_back_with_its_datastore(
    fleet: Fleet, datastore: str, versions: dict[str, str]
) -> None:
    before = on(fleet, f"{BINARY} --version | head -1")
    told = {"kind": "ConfigMap", "apiVersion": "v1", "metadata": {"name": "told-before", "namespace": "default"}}
    fleet.hosts.ssh(EDGE, f"echo '{json.dumps(told)}' | {BINARY} kubectl apply -f -")
    bad = "{{ {'kubelet-arg': ['max-pods=none']} if inventory_hostname == 'edge1' else {} }}"
    run = change(fleet, k3s_airgap_dir=versions["minor"], k3s_config=bad).must(2)
    assert run.host(EDGE)["outcome"] == "rolled-back", run
    assert on(fleet, f"{BINARY} --version | head -1") == before
    left = f"{DATABASE}/etcd-old-*" if datastore == "etcd" else f"{DATABASE}.left"
    fleet.hosts.ssh(EDGE, f"ls -d {left}")  # that of the newer version
    fleet.hosts.ssh(EDGE, f"{BINARY} kubectl delete configmap told-before")
    assert not unproven(fleet, EDGE)
    fleet.wait_settled()
