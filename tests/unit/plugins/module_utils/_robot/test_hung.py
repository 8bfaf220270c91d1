# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which pods hang, by what was asked and what the API shows."""

from __future__ import annotations

from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._robot.hung import Silence, hung_pods
from ansible_collections.rosops.fleet.plugins.module_utils._step.words import LIVENESS, LIVENESS_TIMEOUT
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.app import app_deployment
from ansible_collections.rosops.fleet.tests.unit.robots import robot

HOST = "192.0.2.11"


def pod(name: str, address: str, *, ready: bool = True, host: str = HOST, **notes: str) -> dict[str, Any]:
    return {
        "metadata": {
            "name": f"{name}-x",
            "uid": f"uid of {name}",
            "labels": {"rosops.fleet/app": name},
            "annotations": {"rosops.fleet/ros-node": f"/{name}", **notes},
        },
        "spec": {},
        "status": {
            "podIP": address,
            "hostIP": host,
            "conditions": [{"type": "Ready", "status": "True" if ready else "False"}],
        },
    }


def silence(*answering: str, **silent: float) -> Silence:
    """Addresses end as the pods' do; a node is called as its pod's app."""
    found = {f"/{name}": (f"http://{ADDRESSES[name]}:4711/", seconds) for name, seconds in silent.items()}
    return Silence(found, frozenset(f"http://{ADDRESSES[name]}:4712/" for name in answering))


ADDRESSES = {"camera": "10.42.0.1", "arm": "10.42.0.2", "laptop": "10.0.0.7"}
CAMERA, ARM = pod("camera", ADDRESSES["camera"]), pod("arm", ADDRESSES["arm"])
KEEPER = pod("ros-keeper", "10.42.0.9")


def names(pods: list[dict[str, Any]], known: Silence) -> list[str]:
    return [one.app for one in hung_pods(pods, known)]


def test_what_is_silent_for_so_long_hangs() -> None:
    assert names([CAMERA, ARM], silence("arm", camera=LIVENESS_TIMEOUT - 1)) == []
    (found,) = hung_pods([CAMERA, ARM], silence("arm", camera=LIVENESS_TIMEOUT))
    assert (found.node, found.seconds, found.timeout) == ("/camera", LIVENESS_TIMEOUT, LIVENESS_TIMEOUT)
    assert names([CAMERA, ARM], silence("arm")) == []


def test_a_host_that_is_away_is_no_node_that_hangs() -> None:
    """Nobody of it answers; the keeper, where it is on that host, is somebody who does."""
    all_silent = silence(camera=500, arm=600)
    assert names([CAMERA, ARM], all_silent) == []
    assert names([CAMERA, ARM, KEEPER], all_silent) == ["arm", "camera"]
    elsewhere = pod("ros-keeper", "10.42.0.9", host="192.0.2.1")
    assert names([CAMERA, ARM, elsewhere], all_silent) == []
    other = pod("arm", ADDRESSES["arm"], host="192.0.2.12")
    assert names([CAMERA, other], silence("arm", camera=500)) == []


@pytest.mark.parametrize(
    "other",
    [
        {"ready": False},  # its host may be away, and it may still be at its start
        {LIVENESS: "0"},
        {LIVENESS: "501"},
        {LIVENESS: "soon"},
    ],
)
def test_what_is_left_as_it_is(other: dict[str, Any]) -> None:
    assert names([pod("camera", ADDRESSES["camera"], **other), KEEPER], silence(camera=500)) == []


def test_what_is_no_apps_or_ends_already() -> None:
    going = {**CAMERA, "metadata": {**CAMERA["metadata"], "deletionTimestamp": "now"}}
    assert names([going, KEEPER], silence(camera=500)) == []
    assert names([KEEPER], silence(laptop=5000)) == []
    for name in ("ros-master", "ros-keeper"):
        of_robot = pod(name, ADDRESSES["camera"])
        assert names([of_robot, KEEPER], silence(camera=500)) == []
    nobody = {**CAMERA, "metadata": {**CAMERA["metadata"], "labels": {}}}
    assert names([nobody, KEEPER], silence(camera=500)) == []


def test_with_the_hosts_network_only_the_node_counts_that_the_pod_is_known_by() -> None:
    """The address is everybody's on that host."""
    camera, arm = ({**one, "spec": {"hostNetwork": True}} for one in (pod("camera", HOST), pod("arm", HOST)))
    known = Silence({"/camera": (f"http://{HOST}:1/", 500.0)}, frozenset({f"http://{HOST}:2/"}))
    assert names([camera, arm], known) == ["camera"]


def test_of_several_nodes_in_a_pod_the_longest_silent_counts() -> None:
    address = f"http://{ADDRESSES['camera']}"
    known = Silence({"/base": (f"{address}:1/", 130.0), "/lidar": (f"{address}:2/", 150.0), "/x": ("http://[", 900.0)})
    assert [one.node for one in hung_pods([CAMERA, KEEPER], known)] == ["/lidar"]


def test_a_pod_says_what_is_not_the_usual() -> None:
    """The keeper knows the usual timeout by itself."""

    def notes(**options: Any) -> dict[str, str]:
        of = robot({"name": "camera", "image": "x/camera:1", "command": ["run"], **options})
        return dict(app_deployment(of.apps[0], of)["spec"]["template"]["metadata"]["annotations"])

    assert LIVENESS not in notes()
    assert notes(liveness_timeout=0)[LIVENESS] == "0"
    assert notes(liveness_timeout=30)[LIVENESS] == "30"
