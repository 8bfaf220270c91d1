# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Rigelfiles as fleets: each key is somewhere, nothing is passed over, and the result passes the validation."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import pytest
import yaml
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.finding import join_path
from ansible_collections.rosops.fleet.plugins.plugin_utils._rigel.fleet import imported
from ansible_collections.rosops.fleet.plugins.plugin_utils._rigel.part import CHANGED, LEFT, OPEN, SAME, TAKEN
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._rigel.rigelfiles import (
    CONTAINER,
    JOB,
    NAMES,
    app,
    container,
    made,
    orchestration,
    told,
    verdicts,
    whole,
)


def leaves(value: Any, path: str) -> Iterator[str]:
    """The paths of all that is no mapping and no list of them."""
    if isinstance(value, Mapping) and value:
        for key, item in value.items():
            yield from leaves(item, join_path(path, str(key)))
    elif isinstance(value, list) and any(isinstance(item, Mapping) for item in value):
        for index, item in enumerate(value):
            yield from leaves(item, join_path(path, index))
    else:
        yield path


@pytest.mark.parametrize("name", NAMES)
def test_nothing_is_passed_over_in_silence(name: str) -> None:
    """Something is said of each key, of what it is part of, or of its part; of each job and each sequence by name."""
    noted = verdicts(imported(whole(name), "Rigelfile", {}, "arms"))
    given = yaml.safe_load(whole(name))
    unsaid = [
        leaf
        for leaf in leaves(given, "")
        if not any(leaf == path or leaf.startswith((f"{path}.", f"{path}[")) for path in noted)
        and not leaf.endswith((".plugin", ".name"))
    ]
    assert unsaid == []
    assert {f"sequences.{key}" for key in given["sequences"]} <= {*noted}


def test_the_public_examples_model() -> None:
    found = imported(whole("pubsub"), "Rigelfile", {}, "arms")
    assert found.all == {
        "fleet_name": "arms",
        "observability": {
            "enabled": True,
            "grafana": {
                "enabled": True,
                "default_dashboards": True,
                "service_type": "NodePort",
                "persistence": {"enabled": True, "size": "2Gi"},
            },
            "prometheus": {
                "enabled": True,
                "scrape_interval": "10s",
                "evaluation_interval": "10s",
                "retention": "7d",
            },
            "loki": {"enabled": True, "retention": "7d", "persistence": {"enabled": True, "size": "5Gi"}},
            "node_exporter": True,
            "ros_metrics": True,
        },
        "rigel_programs": "/opt/rosops-apps/bin",
        "rigel_distro": "noetic",
        "rigel_base_image": "registry.example.org/temperature:1.0",
    }
    probe = {"command": "/opt/rosops-apps/bin/readiness_probe.sh"}
    assert found.robots == {
        "ros_master_mode": "robot",
        "ros_master_image": "ros:noetic-ros-core",
        "persistent_storage": {"volumes": [{"name": "logs-volume", "size": "1Gi"}]},
        "ros_apps": [
            {
                "name": "temperature-app",
                "image": "registry.example.org/temperature:1.0",
                "command": ["/opt/rosops-apps/bin/temperature_subscriber"],
                "env": {
                    "LOG_DIR": "/mnt/data/logs-volume",
                    "APP_VERSION": "{{ vars.base_image | regex_replace('.*:', '') }}",
                },
                "placement": "remote",
                "volumes": [{"name": "logs-volume"}],
                "readiness": probe,
            },
            {
                "name": "temperature",
                "image": "registry.example.org/temperature:1.0",
                "command": ["/opt/rosops-apps/bin/temperature_publisher"],
                "env": {"RATE_HZ": "500"},
                "placement": "remote",
                "handoff": "overlap",
            },
        ],
    }


def test_two_jobs_are_two_apps_of_one_fleet() -> None:
    found = imported(whole("service"), "Rigelfile", {}, "arms")
    server, client = found.robots["ros_apps"]
    assert (server["name"], server["placement"], server["handoff"]) == ("server", "local", "overlap")
    assert server["resources"] == {"requests": {"cpu": "50m"}, "limits": {"memory": "256Mi"}}
    assert (client["name"], client["placement"], "handoff" in client) == ("client", "remote", False)
    # a claim's name has no underscore; the app finds its data where it looks for it
    assert found.robots["persistent_storage"]["volumes"] == [
        {"name": "arithmetic-logs", "size": "1Gi", "mountPath": "/mnt/data/arithmetic_logs"}
    ]


def test_jobs_at_the_top_of_the_file() -> None:
    found = imported(whole("action"), "Rigelfile", {}, "arms")
    assert [one["name"] for one in found.robots["ros_apps"]] == ["primes", "prime-factors"]
    assert found.all["observability"] == {"enabled": False}
    assert found.robots["persistent_storage"]["volumes"] == [
        {"name": "primes", "size": "1Gi", "mountPath": "/data/primes"}
    ]


SECRET = {"secretKeyRef": {"name": "arm", "key": "token"}}
APP_KEYS: list[tuple[str, dict[str, Any], str, Any, str]] = [
    # case, what the orchestration says, the key of the app, its value, what is said at which path
    ("readiness", {"readiness": {"command": "/ready.sh"}}, "readiness", {"command": "/ready.sh"}, "readiness.command"),
    ("timeout", {"readiness": {"timeout_seconds": 90}}, "readiness", {"timeout": 90}, "readiness.timeout_seconds"),
    ("rolling", {"rolling_update": {"strategy": "Rolling"}}, "handoff", "overlap", "rolling_update.strategy"),
    ("surge", {"rolling_update": {"max_surge": 1}}, "handoff", "overlap", "rolling_update.max_surge"),
    (
        "no surge",
        {"rolling_update": {"strategy": "Rolling", "max_surge": 0}},
        "handoff",
        None,
        "rolling_update.max_surge",
    ),
    ("recreate", {"rolling_update": {"strategy": "Recreate"}}, "handoff", None, "rolling_update.strategy"),
    ("remote", {"distributed": {"enabled": True}}, "placement", "remote", "distributed.enabled"),
    (
        "forced",
        {"distributed": {"enabled": True, "default_to_remote": True, "force_local_flag": True}},
        "placement",
        "local",
        "distributed.force_local_flag",
    ),
    (
        "not by default",
        {"distributed": {"enabled": True, "default_to_remote": False}},
        "placement",
        "local",
        "distributed.default_to_remote",
    ),
    ("one host", {}, "placement", "local", ""),
    ("named", {"deployment_name": "My_Arm"}, "name", "my-arm", "deployment_name"),
    ("by its image", {}, "name", "arm", ""),
    ("results", {"results": {"source_path": "/mnt/data/x"}}, "volumes", None, "results.source_path"),
]


@pytest.mark.parametrize(
    ("given", "key", "value", "path"), [case[1:] for case in APP_KEYS], ids=[c[0] for c in APP_KEYS]
)
def test_a_key_of_the_orchestration(given: dict[str, Any], key: str, value: Any, path: str) -> None:
    found = made(orchestration(**given))
    assert app(found).get(key) == value
    assert not path or told(found, f"{JOB}.{path}")


CONTAINER_KEYS: list[tuple[str, dict[str, Any], str, Any, str, str]] = [
    ("env", {"env": [{"name": "A", "value": "b"}]}, "env", {"A": "b"}, "env[0]", TAKEN),
    ("number", {"env": [{"name": "A", "value": 5}]}, "env", {"A": "5"}, "env[0]", TAKEN),
    (
        "secret",
        {"env": [{"name": "A", "valueFrom": SECRET}]},
        "env",
        {"A": {"secret": "arm", "key": "token"}},
        "env[0]",
        OPEN,
    ),
    ("password", {"env": [{"name": "API_TOKEN", "value": "x"}]}, "env", {"API_TOKEN": "x"}, "env[0]", OPEN),
    ("ours", {"env": [{"name": "ROS_MASTER_URI", "value": "http://ros-master:11311"}]}, "env", None, "env[0]", SAME),
    ("the master's port", {"ports": [{"containerPort": 11311}]}, "ports", None, "ports[0]", SAME),
    ("port", {"ports": [{"containerPort": 8080}]}, "ports", [{"name": "port-8080", "port": 8080}], "ports[0]", TAKEN),
    (
        "port of the host",
        {"ports": [{"name": "WEB", "containerPort": 80, "hostPort": 8000, "protocol": "UDP"}]},
        "ports",
        [{"name": "web", "port": 80, "protocol": "UDP", "host_port": 8000}],
        "ports[0]",
        TAKEN,
    ),
    (
        "probe",
        {"readinessProbe": {"exec": {"command": ["sh", "-c", "true"]}}},
        "readiness",
        {"command": ["sh", "-c", "true"]},
        "readinessProbe.exec.command",
        TAKEN,
    ),
    (
        "delay",
        {"readinessProbe": {"exec": {"command": ["/r"]}, "initialDelaySeconds": 10}},
        "readiness",
        {"command": "/r"},
        "readinessProbe.initialDelaySeconds",
        CHANGED,
    ),
    (
        "period within exec",
        {"readinessProbe": {"exec": {"command": ["/r"], "periodSeconds": 5}}},
        "readiness",
        {"command": "/r"},
        "readinessProbe.exec.periodSeconds",
        CHANGED,
    ),
    ("asked by HTTP", {"readinessProbe": {"httpGet": {"port": 80}}}, "readiness", None, "readinessProbe.httpGet", LEFT),
    ("liveness", {"livenessProbe": {"exec": {"command": ["/l"]}}}, "liveness_timeout", None, "livenessProbe", CHANGED),
    (
        "resources",
        {"resources": {"limits": {"memory": "1Gi"}}},
        "resources",
        {"limits": {"memory": "1Gi"}},
        "resources",
        TAKEN,
    ),
    (
        "anything else",
        {"securityContext": {"runAsUser": 1000}},
        "overrides",
        {"spec": {"template": {"spec": {"containers": [{"name": "ros-app", "securityContext": {"runAsUser": 1000}}]}}}},
        "securityContext",
        TAKEN,
    ),
    (
        "launch file",
        {"command": ["/ros_entrypoint.sh"], "args": ["roslaunch", "arm", "arm.launch", "speed:=2"]},
        "launch",
        {"package": "arm", "file": "arm.launch", "args": {"speed": "2"}},
        "args",
        TAKEN,
    ),
]


@pytest.mark.parametrize(
    ("keys", "key", "value", "path", "verdict"),
    [case[1:] for case in CONTAINER_KEYS],
    ids=[c[0] for c in CONTAINER_KEYS],
)
def test_a_key_of_the_container(keys: dict[str, Any], key: str, value: Any, path: str, verdict: str) -> None:
    found = made(orchestration(container(**keys)))
    assert app(found).get(key) == value
    assert verdicts(found)[f"{CONTAINER}.{path}"] == verdict


def test_what_the_image_runs_is_asked_of_the_job_dockerfile() -> None:
    given = orchestration({"name": "ros-app", "image": "x.example/arm:1.0"})
    found = made(given, jobs={"dockerfile": {"plugin": "p.DockerfilePlugin", "with": {"command": "rosrun arm 'a b'"}}})
    assert app(found)["args"] == ["rosrun", "arm", "a b"]
    silent = made(given)
    assert app(silent)["readiness"] == {"nodes": False}
    assert verdicts(silent)[CONTAINER] == TAKEN
    assert "readiness.topics" in told(silent, CONTAINER)


def test_what_cannot_overlap_is_replaced_and_the_validation_says_why() -> None:
    shell = container(command=["sh", "-c", "rosrun arm arm"])
    found = made(orchestration(shell, rolling_update={"strategy": "Rolling", "max_surge": 1}))
    assert "handoff" not in app(found)
    assert "is overlap, but the script of sh -c" in told(found, f"{JOB}.rolling_update")


def test_mounts_of_claims_of_the_host_and_of_the_pod() -> None:
    given = orchestration(
        container(
            volumeMounts=[
                {"name": "data", "mountPath": "/persistent"},
                {"name": "dev", "mountPath": "/mnt/dev"},
                {"name": "scratch", "mountPath": "/scratch"},
            ]
        ),
        pod={
            "volumes": [
                {"name": "data", "persistentVolumeClaim": {"claimName": "logs-pvc"}},
                {"name": "dev", "hostPath": {"path": "/srv/dev"}},
                {"name": "scratch", "emptyDir": {}},
            ]
        },
        persistent_storage={"volumes": [{"name": "logs", "size": "1Gi", "storage_class": "fast"}]},
    )
    found = made(given)
    assert app(found)["volumes"] == [{"name": "logs", "mount_path": "/persistent"}]
    assert app(found)["host_paths"] == [{"path": "/srv/dev", "mount_path": "/mnt/dev", "read_only": False}]
    pod = app(found)["overrides"]["spec"]["template"]["spec"]
    assert pod["volumes"] == [{"name": "scratch", "emptyDir": {}}]
    assert pod["containers"][0]["volumeMounts"] == [{"name": "scratch", "mountPath": "/scratch"}]
    assert found.robots["persistent_storage"]["volumes"] == [{"name": "logs", "size": "1Gi", "storage_class": "fast"}]
    assert verdicts(found)[f"{JOB}.persistent_storage.volumes[0].storage_class"] == OPEN


def test_the_master() -> None:
    own = {"name": "ros-master-container", "image": "x.example/master:1", "resources": {"limits": {"cpu": "1"}}}
    given = orchestration()
    given["additional_k8s_params"]["ros_master"] = {"spec": {"template": {"spec": {"containers": [own]}}}}
    found = made(given)
    assert found.robots["ros_master_image"] == "x.example/master:1"
    assert found.robots["ros_master_overrides"] == {
        "spec": {
            "template": {
                "spec": {"containers": [{"name": "ros-master-container", "resources": {"limits": {"cpu": "1"}}}]}
            }
        }
    }
    address = {"name": "ROS_MASTER_URI", "value": "http://192.0.2.7:11311"}
    external = made(orchestration(container(env=[address]), deploy_ros_master=False))
    assert external.robots["ros_master_mode"] == "external"
    assert external.robots["ros_master_uri"] == "http://192.0.2.7:11311"
    unknown = made(orchestration(deploy_ros_master=False))
    assert verdicts(unknown)[f"{JOB}.deploy_ros_master"] == OPEN
    assert made(orchestration(), application={"distro": "noetic"}).robots["ros_master_image"] == "ros:noetic-ros-core"


def test_a_password_is_written_nowhere_and_the_listings_places_are_read() -> None:
    given = orchestration(
        observability={"enabled": True},
        grafana={"admin_password": "hunter2", "service_type": "LoadBalancer"},
        loki={"chart": "x"},
    )
    found = made(given)
    assert found.all["observability"] == {"enabled": True}
    assert "hunter2" not in str(found)
    noted = verdicts(found)
    assert noted[f"{JOB}.observability.grafana.admin_password"] == OPEN
    assert noted[f"{JOB}.observability.grafana.service_type"] == CHANGED
    assert noted[f"{JOB}.observability.loki.chart"] == LEFT


def test_dashboards_come_along() -> None:
    given = orchestration()
    given["additional_k8s_params"]["observability"] = {"grafana": {"dashboard": "graphs/arm.json"}}
    found = made(given)
    assert found.dashboards == ("graphs/arm.json",)
    assert found.all["observability_dashboards"] == ["../dashboards/arm.json"]


@pytest.mark.parametrize(
    ("job", "words"),
    [
        ({"plugin": "rigel.plugins.core.DockerfilePlugin"}, "your CI"),
        ({"plugin": "rigel.plugins.core.BuildXPlugin"}, "images_archives"),
        ({"plugin": "rigel.plugins.core.ComposePlugin"}, "lab"),
        ({"plugin": "rigel.plugins.core.TestPlugin", "with": {"x": "{{ data.y }}"}}, "tests"),
        ({"plugin": "rigel.plugins.aws.RoboMakerPlugin"}, "simulations"),
        ({"plugin": "rigel_registry_plugin"}, "robot_namespace_pull_secrets"),
        ({"plugin": "acme.Notify"}, "acme.Notify is not known"),
    ],
)
def test_other_jobs_say_who_does_that_now(job: dict[str, Any], words: str) -> None:
    found = made(orchestration(), jobs={"other": job})
    assert verdicts(found)["jobs.other"] == LEFT
    assert words in told(found, "jobs.other")


def test_sequences_are_commands() -> None:
    jobs = {"build": {"plugin": "p.BuildXPlugin"}, "update_k8s": {"with": {"orchestration": {}}}}
    sequences = {
        "demo": {"stages": [{"jobs": ["build", {"name": "deploy_k8s", "with": {}}]}], "matrix": {"a": [1]}},
        "update": ["update_k8s"],
    }
    found = made(orchestration(), jobs=jobs, sequences=sequences)
    assert told(found, "sequences.demo") == "build: in your CI; then ansible-playbook rosops.fleet.site"
    assert told(found, "sequences.update") == "ansible-playbook rosops.fleet.update"
    assert verdicts(found)["sequences.demo.matrix"] == LEFT


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (orchestration(readiness=5), f"{JOB}.readiness: is the number 5; allowed: a mapping"),
        (orchestration(deploy_ros_master="yes"), f"{JOB}.deploy_ros_master: is 'yes'; allowed: true or false"),
        (orchestration(container(image="")), f"{CONTAINER}.image: is missing"),
        (orchestration(container(command="run it")), f"{CONTAINER}.command: is 'run it'; allowed: a list"),
        (
            orchestration(persistent_storage={"volumes": [{"name": "logs", "size": "1 GB"}]}),
            "jobs.deploy_k8s: as persistent_storage.volumes[0].size: is '1 GB'",
        ),
        (
            orchestration(container(args=["roscore"])),
            "jobs.deploy_k8s: as ros_apps[0].args[0]: starts a second ROS master",
        ),
    ],
)
def test_an_error_says_where_and_what_would_be_right(given: dict[str, Any], said: str) -> None:
    with pytest.raises(SpecError) as error:
        made(given)
    assert said in str(error.value)


def test_a_file_without_a_job_that_deploys() -> None:
    with pytest.raises(SpecError, match=r"has no job that deploys .its jobs: build."):
        imported("jobs: {build: {plugin: x}}", "Rigelfile", {}, "arms")


def test_unknown_keys_are_told() -> None:
    given = orchestration(gpu=True)
    given["additional_k8s_params"]["job"] = {"kind": "Job"}
    found = made(given, providers={"hub": {}}, packages={"arm": {"dir": "src"}})
    noted = verdicts(found)
    for path in (f"{JOB}.gpu", f"{JOB}.additional_k8s_params.job", "providers", "packages.arm"):
        assert noted[path] == LEFT, path
