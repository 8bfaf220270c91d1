# SPDX-License-Identifier: GPL-3.0-or-later
"""What the levels of the Pod Security Standards refuse: of any pod, as the standards list it, and of ours nothing."""

from __future__ import annotations

from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.parts import PARTS, workload_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.pod_security import refused
from ansible_collections.rosops.fleet.plugins.plugin_utils._validate.fleet import check_fleet
from ansible_collections.rosops.fleet.tests.unit.robots import robot

Object = dict[str, Any]
FIT: Object = {
    "allowPrivilegeEscalation": False,
    "runAsNonRoot": True,
    "seccompProfile": {"type": "RuntimeDefault"},
    "capabilities": {"drop": ["ALL"]},
}


def pod(security: Object | None = None, container: Object | None = None, **spec: Any) -> Object:
    """A pod that `restricted` takes, but for what is given."""
    one = {"name": "c", "securityContext": {**FIT, **(security or {})}, **(container or {})}
    return {"containers": [one], **spec}


@pytest.mark.parametrize(
    ("spec", "baseline", "restricted"),
    [
        (pod(), [], []),
        # baseline, in the standards' order
        (pod(hostNetwork=True, hostPID=True, hostIPC=True), ["hostNetwork", "hostPID", "hostIPC"], None),
        (pod({"privileged": True}), ["privileged (container c)"], None),
        (pod({"capabilities": {"add": ["SYS_NICE"], "drop": ["ALL"]}}), ["capability SYS_NICE (container c)"], None),
        (pod(volumes=[{"name": "v", "hostPath": {"path": "/"}}]), ["hostPath (volume v)"], None),
        (pod(container={"ports": [{"containerPort": 1, "hostPort": 1}]}), ["hostPort (container c)"], None),
        (pod({"appArmorProfile": {"type": "Unconfined"}}), ["appArmorProfile (container c)"], None),
        (pod({"seLinuxOptions": {"type": "spc_t"}}), ["seLinuxOptions (container c)"], None),
        (pod({"seLinuxOptions": {"type": "container_t", "user": "u"}}), ["seLinuxOptions (container c)"], None),
        (pod({"procMount": "Unmasked"}), ["procMount (container c)"], None),
        (pod({"seccompProfile": {"type": "Unconfined"}}), ["seccompProfile (container c)"], None),
        (pod(securityContext={"sysctls": [{"name": "kernel.msgmax"}]}), ["sysctl kernel.msgmax"], None),
        (pod(securityContext={"sysctls": [{"name": "net.ipv4.tcp_syncookies"}]}), [], []),
        # restricted
        (pod(volumes=[{"name": "v", "nfs": {}}]), [], ["nfs (volume v)"]),
        (pod(volumes=[{"name": "v", "emptyDir": {}}, {"name": "w", "projected": {}}]), [], []),
        (pod({"allowPrivilegeEscalation": None}), [], ["allowPrivilegeEscalation (container c)"]),
        (pod({"seccompProfile": None}), [], ["no seccompProfile (container c)"]),
        (pod({"runAsNonRoot": False}), [], ["no runAsNonRoot (container c)"]),
        (pod({"runAsUser": 0}), [], ["runAsUser 0 (container c)"]),
        (pod({"capabilities": {"add": ["CHOWN"], "drop": ["ALL"]}}), [], ["capability CHOWN (container c)"]),
        (pod({"capabilities": {"add": ["NET_BIND_SERVICE"], "drop": ["ALL"]}}), [], []),
        (pod({"capabilities": {"drop": ["NET_RAW"]}}), [], ["no capabilities.drop ALL (container c)"]),
        # of all containers, and what the pod says for those that say nothing
        (pod(initContainers=[{"name": "i", "securityContext": {"privileged": True}}], securityContext=FIT),
         ["privileged (container i)"],
         ["privileged (container i)", "allowPrivilegeEscalation (container i)",
          "no capabilities.drop ALL (container i)"]),
        ({"containers": [{"name": "c", "securityContext": {key: FIT[key] for key in FIT if key[0] in "ac"}}],
          "securityContext": {key: FIT[key] for key in FIT if key[0] in "rs"}}, [], []),
    ],
)  # fmt: skip
def test_what_a_level_refuses(spec: Object, baseline: list[str], restricted: list[str] | None) -> None:
    assert refused(spec, "baseline") == baseline
    assert refused(spec, "restricted") == (baseline if restricted is None else restricted)
    assert refused(spec, "privileged") == refused(spec, "") == []


NON_ROOT = {"runAsNonRoot": True, "runAsUser": 1000}
OWN = {"name": "ros-app", "securityContext": {"capabilities": {"drop": ["ALL"]}}}
APP: Object = {
    "name": "talker", "image": "example.org/talker:1.0", "args": ["talk"], "placement": "local",
    "overrides": {"spec": {"template": {"spec": {"securityContext": NON_ROOT, "containers": [OWN]}}}},
}  # fmt: skip


@pytest.mark.parametrize("hooks", ["app", "sidecar", "none"])
def test_a_robot_with_ordinary_apps_fits_the_strictest_level(hooks: str) -> None:
    """Whatever is made for it, and with volumes and metrics; its apps say a user of theirs, and drop capabilities."""
    volumes = [{"name": "data", "size": "1Gi"}]
    app = {**APP, "hooks": hooks, "volumes": [{"name": "data"}]}
    made = robot(app, volumes=volumes, pod_security="restricted", observability={"enabled": True})
    pods = [one["spec"]["template"]["spec"] for one in workload_objects(made, PARTS) if one["kind"] == "Deployment"]
    assert [refused(one, "restricted") for one in pods] == [[], [], []]
    said = {
        "robot_namespace_pod_security": "restricted",
        "persistent_storage": {"volumes": volumes},
        "ros_apps": [app],
        "observability": {"enabled": True},
    }
    report = check_fleet({"edge": ["edge1"], "robots": ["robot1"]}, {"edge1": {}, "robot1": said})
    assert [one.line() for one in report.problems] == []


@pytest.mark.parametrize(
    "overrides",
    [
        {"securityContext": {"runAsUser": 0}},
        {"volumes": [{"name": "log", "hostPath": {"path": "/var/log/ros"}}]},
        {"containers": [{"name": "ros-master-container", "securityContext": {"runAsNonRoot": False}}]},
    ],
)
def test_a_user_that_overrides_say_is_kept(overrides: Object) -> None:
    made = robot(master={"overrides": {"spec": {"template": {"spec": overrides}}}})
    [master, *_others] = workload_objects(made, ["master"])
    said = master["spec"]["template"]["spec"]["containers"][0]["securityContext"]
    assert "runAsUser" not in said
    assert said["capabilities"] == {"drop": ["ALL"]}
