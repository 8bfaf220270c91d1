# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
from __future__ import annotations

from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._robot.main import options
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.keeper import keeper_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.master import master_objects, ros_core_objects
from ansible_collections.rosops.fleet.tests.unit.robots import robot


def objects(**master: Any) -> list[dict[str, Any]]:
    return keeper_objects(robot(name="r1", master=master))


@pytest.mark.parametrize(
    ("mode", "namespace", "uri", "selector"),
    [
        ("robot", "robot-r1", "http://ros-master:11311", {"rosops.fleet/robot": "r1"}),
        ("shared", "fleet", "http://ros-master.fleet:11311", {"deploymentType": "remote"}),
    ],
)
def test_beside_its_master(mode: str, namespace: str, uri: str, selector: dict[str, str]) -> None:
    deployment, service = objects(mode=mode, image="ros:x")
    master = ros_core_objects(robot(name="r1", master={"mode": mode, "image": "ros:x"}))[0]
    pod = deployment["spec"]["template"]["spec"]
    assert {item["metadata"]["namespace"] for item in (deployment, service)} == {namespace}
    assert pod["nodeSelector"] == selector == master["spec"]["template"]["spec"]["nodeSelector"]
    container = pod["containers"][0]
    assert container["image"] == "ros:x"
    assert {"name": "ROS_MASTER_URI", "value": uri} in container["env"]
    labels = deployment["spec"]["template"]["metadata"]["labels"]
    assert service["spec"]["selector"].items() <= labels.items()
    assert service["spec"]["ports"][0]["port"] == container["ports"][0]["containerPort"] == 11411


def test_never_two_of_them() -> None:
    assert objects()[0]["spec"]["strategy"] == {"type": "Recreate"}


def test_none_for_an_external_master() -> None:
    assert objects(mode="external", uri="http://192.0.2.1:11311") == []


def test_what_it_mounts() -> None:
    pod = objects()[0]["spec"]["template"]["spec"]
    volumes = {volume["name"]: volume for volume in pod["volumes"]}
    mounts = {mount["name"]: mount for mount in pod["containers"][0]["volumeMounts"]}
    assert set(volumes) == set(mounts) == {"rosops-code", "record"}
    assert mounts["rosops-code"]["readOnly"]
    assert "emptyDir" in volumes["record"]
    assert mounts["record"]["mountPath"] in pod["containers"][0]["command"][-1]


def test_probes_start_no_process() -> None:
    container = objects()[0]["spec"]["template"]["spec"]["containers"][0]
    for probe, period in (("startupProbe", 1), ("readinessProbe", 10)):
        assert container[probe]["httpGet"]["port"] == 11411
        assert container[probe]["periodSeconds"] == period
    assert "livenessProbe" not in container


def test_it_can_be_called_while_its_kubelet_starts_again() -> None:
    assert objects()[1]["spec"]["publishNotReadyAddresses"] is True


def test_the_masters_overrides_are_not_the_keepers() -> None:
    """Nor does a change of the master restart it: it is there to outlive that."""
    overrides = {"spec": {"template": {"spec": {"hostNetwork": True}}}}
    assert objects(overrides=overrides) == objects()
    both = master_objects(robot(name="r1", master={"overrides": overrides}))
    assert [(item["kind"], item["metadata"]["name"]) for item in both] == [
        ("Deployment", "ros-master"),
        ("Service", "ros-master"),
        ("Deployment", "ros-keeper"),
        ("Service", "ros-keeper"),
    ]
    assert "hostNetwork" in both[0]["spec"]["template"]["spec"]


def test_pull_secrets() -> None:
    pod = keeper_objects(robot(pull_secrets=[{"name": "registry", "user": "x"}]))[0]["spec"]["template"]["spec"]
    assert pod["imagePullSecrets"] == [{"name": "registry"}]


def test_goal_forwarding_is_switched_off_by_a_word_of_its_command() -> None:
    on, off = (objects(goal_forwarding=word)[0]["spec"]["template"]["spec"]["containers"][0] for word in (True, False))
    assert on == objects()[0]["spec"]["template"]["spec"]["containers"][0]
    assert off == {**on, "command": [*on["command"], "--goal-forwarding", "off"]}
    words = off["command"][off["command"].index("keeper") + 1 :]
    assert options(words)["--goal-forwarding"] == "off"
