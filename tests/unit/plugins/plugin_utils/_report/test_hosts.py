# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Who is off, which cluster can be asked, and who reads whose ROS graph."""

from __future__ import annotations

from typing import Any

from ansible_collections.rosops.fleet.plugins.plugin_utils._model.topology import ClusterPart
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.hosts import (
    Member,
    clusters_of,
    graphs_to_read,
    members,
    promised_rates,
    unmeasured,
    usage_of,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.look import Asked
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.rows import Host, Promise, Workload
from ansible_collections.rosops.fleet.tests.unit.robots import fleet

GROUPS = {"edge": ["edge1"], "robots": ["robot1", "robot2", "lone"]}
VARIABLES: dict[str, dict[str, Any]] = {
    "edge1": {"ansible_host": "10.0.0.11"},
    "robot1": {},
    "robot2": {},
    "lone": {"robot_mode": "standalone"},
}
OFF = {"unreachable": True, "msg": "Task failed: timed out"}


def found(
    *names: str, off: tuple[str, ...] = (), every: dict[str, Any] | None = None, **more: dict[str, Any]
) -> list[Member]:
    hostvars = {name: {**own, **(every or {}), **more.get(name, {})} for name, own in VARIABLES.items()}
    run = {name: hostvars[name] for name in names or hostvars}
    addresses = {name: str(own.get("ansible_host", name)) for name, own in run.items()}
    return members(fleet(GROUPS, hostvars), addresses, dict.fromkeys(off, OFF))


def pods(robot: str, *addresses: str) -> Workload:
    return Workload(robot, "base", addresses=addresses)


def service(namespace: str, address: str, name: str = "ros-master") -> dict[str, Any]:
    return {"metadata": {"name": name, "namespace": namespace}, "spec": {"clusterIP": address}}


def test_rows_of_hosts() -> None:
    edge, robot = (one.row for one in found("edge1", "robot2", off=("robot2",)))
    assert edge == Host("edge1", "edge", "10.0.0.11", "server", "edge")
    assert robot == Host("robot2", "robots", "robot2", "agent", "edge", False, "timed out")


def test_each_cluster_is_asked_with_one_of_its_hosts() -> None:
    asked, silent = clusters_of(found())
    assert (asked, silent) == ({"edge": "edge1", "lone": "lone"}, {})


def test_a_cluster_whose_servers_are_off_is_not_waited_for() -> None:
    asked, silent = clusters_of(found(off=("edge1",)))
    assert (list(asked), silent) == (["lone"], {"edge": "its servers are unreachable"})


def test_servers_outside_of_the_limit_may_be_up() -> None:
    asked, silent = clusters_of(found("robot1", "robot2", off=("robot1",)))
    assert (list(asked), silent) == (["edge"], {})


def test_one_server_that_answers_is_enough() -> None:
    part = ClusterPart("server", "edge", ("a", "b", "c"), False, "")
    hosts = [Member(name, "", part, away=None if name == "c" else "off") for name in part.servers]
    assert list(clusters_of(hosts)[0]) == ["edge"]


def test_every_robot_reads_its_own_masters_graph() -> None:
    services = {
        "edge": [service("robot-robot1", "10.43.0.1"), service("robot-robot2", "10.43.0.2"), service("fleet", "x")],
        "lone": [service("robot-lone", "10.43.0.1", "other"), service("robot-lone", "10.43.0.3")],
    }
    apps = [pods("robot1", "10.42.0.7"), pods("robot2"), pods("(shared)", "10.42.0.9")]
    assert graphs_to_read(found(), services, apps) == {
        "robot1": Asked("robot1", "http://10.43.0.1:11311", ("10.42.0.7", "10.42.0.9")),
        "robot2": Asked("robot2", "http://10.43.0.2:11311", ("10.42.0.9",)),
        "lone": Asked("lone", "http://10.43.0.3:11311", ("10.42.0.9",)),
    }


def test_a_robot_that_is_off_or_has_no_master_reads_nothing() -> None:
    services = {"edge": [service("robot-robot1", "10.43.0.1")]}
    assert graphs_to_read(found(off=("robot1",)), services, []) == {}


def test_a_shared_masters_graph_is_read_by_the_first_robot_that_answers() -> None:
    services = {"edge": [service("fleet", "10.43.0.9")], "lone": [service("fleet", "10.43.0.8")]}
    every = {"ros_master_mode": "shared"}
    lone = Asked("lone", "http://10.43.0.8:11311")  # shares with nobody
    shared = Asked("(shared)", "http://10.43.0.9:11311", ("10.42.0.7",))
    apps = [pods("robot2", "10.42.0.7")]
    assert graphs_to_read(found(every=every), services, apps) == {"robot1": shared, "lone": lone}
    assert graphs_to_read(found(every=every, off=("robot1",)), services, apps) == {"robot2": shared, "lone": lone}


def test_an_external_master_needs_no_service() -> None:
    external = {"ros_master_mode": "external", "ros_master_uri": "http://hall:11311"}
    assert graphs_to_read(found(robot2=external), {}, []) == {"robot2": Asked("robot2", "http://hall:11311")}


def test_what_volumes_hold() -> None:
    path = "/var/lib/rancher/k3s/storage/pvc-3f_robot-robot1_logs-pvc"
    assert usage_of(
        [
            {"stdout_lines": [f"4096\t{path}", "12 /somewhere/else", "du: cannot read"]},
            {"stdout_lines": []},
            OFF,
            {"stdout_lines": ["7\t/var/lib/rancher/k3s/storage/pvc-aa_fleet_maps"]},
        ]
    ) == {"robot-robot1/logs-pvc": 4096, "fleet/maps": 7}


def test_a_host_whose_volumes_take_too_long_is_a_problem() -> None:
    results: dict[str, Any] = {
        "fine": {"rc": 0},
        "empty": {"rc": 1},
        "slow": {"rc": 124},
        "stuck": {"rc": 137},
        "off": OFF,
    }
    assert [problem.where for problem in unmeasured(results)] == ["volumes of slow", "volumes of stuck"]


def test_rates_that_apps_promise() -> None:
    topics = [{"name": "odom", "min_rate": 18}, {"name": "~own", "min_rate": 5}, {"name": "/scan", "publishers": 2}]
    app = {"name": "base", "image": "a:1", "command": ["a"], "pattern": "pubsub", "readiness": {"topics": topics}}
    fused = {**app, "name": "fused", "readiness": {"topics": [{"name": "/scan", "min_rate": 10, "publishers": 2}]}}
    told = promised_rates(found("robot1", "edge1", robot1={"ros_apps": [app, fused]}))
    assert told == {
        "robot1": {
            "/odom": Promise(18, "base", "robot1"),
            "/scan": Promise(10, "fused", "robot1"),
        }
    }
