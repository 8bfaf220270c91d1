# SPDX-License-Identifier: GPL-3.0-or-later
"""The ROS master and the keeper: beside each other, and what each is asked."""

from __future__ import annotations

import subprocess
import threading
from typing import Any
from xmlrpc.server import SimpleXMLRPCServer

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._exporter import updates
from ansible_collections.rosops.fleet.plugins.module_utils._robot import main as keeper_main
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects import master
from ansible_collections.rosops.fleet.tests.unit.robots import robot

Object = dict[str, Any]
VOLUMES = [{"name": "a", "size": "1Ki"}]
SEEN = {"enabled": True}
EXTERNAL = {"mode": "external", "uri": "http://192.0.2.1:11311"}


def pod(deployment: Object) -> Any:
    return deployment["spec"]["template"]["spec"]


def test_goal_forwarding_is_switched_off_by_a_word_of_its_command() -> None:
    made = (master.keeper_objects(robot(master={"goal_forwarding": word})) for word in (True, False))
    on, off = (pod(deployment)["containers"][0] for deployment, _service in made)
    assert off == {**on, "command": [*on["command"], "--goal-forwarding", "off"]}
    assert keeper_main.options(off["command"][off["command"].index("keeper") + 1 :])["--goal-forwarding"] == "off"


# --- the metrics ------------------------------------------------------------------------------------------------------


def shown(**of: Any) -> Object:
    """The keeper's pod: its annotations, the options that its process finds, its volumes and capabilities."""
    [deployment, *_service] = master.keeper_objects(robot(name="r1", **of))
    container, template = pod(deployment)["containers"][0], deployment["spec"]["template"]
    return {
        "notes": {key: text for key, text in template["metadata"]["annotations"].items() if "prometheus" in key},
        "options": keeper_main.options(container["command"][container["command"].index("keeper") + 1 :]),
        "volumes": [volume["name"] for volume in pod(deployment)["volumes"]],
        "add": container["securityContext"]["capabilities"].get("add", []),
        "mounts": {mount["name"]: mount["mountPath"] for mount in container["volumeMounts"]},
    }


def test_its_pod_is_found_and_has_the_record_of_updates() -> None:
    """Switched on later, the cluster's stack asks the keepers that are there."""
    made = shown()
    assert made["notes"]["prometheus.io/scrape"] == "true"
    assert f"{made['mounts']['updates']}/updates.json" == updates.FILE == made["options"]["--updates"]
    assert made["options"]["--keep"] == "on"
    assert shown(observability={"ros_metrics": False})["notes"] == {}
    assert shown(observability={"ros_metrics": False}, master={"mode": "shared"})["notes"] == made["notes"]


@pytest.mark.parametrize(
    ("of", "sees"),
    [
        ({}, True),
        ({"pod_security": "privileged"}, True),
        ({"pod_security": "baseline"}, False),
        ({"pod_security": "restricted"}, False),
        ({"volumes": []}, False),
        ({"observability": {}}, False),
        ({"observability": {**SEEN, "ros_metrics": False}}, False),
        ({"master": {"mode": "shared"}}, False),
        ({"master": EXTERNAL}, True),
    ],
)
def test_it_sees_what_claims_hold_unless_the_namespace_forbids_it(of: Object, sees: bool) -> None:
    made = shown(**{"volumes": VOLUMES, "observability": SEEN, **of})
    said = ("--claims", "--namespace", "--capacities")
    wanted = (master.CLAIMS_DIR, "robot-r1", '{"a-pvc": 1024}')
    assert tuple(made["options"][word] for word in said) == (wanted if sees else ("", "", "{}"))
    assert ("claims" in made["volumes"], made["add"]) == (sees, ["DAC_OVERRIDE"] if sees else [])
    assert made["mounts"].get("claims") == (wanted[0] if sees else None)


# --- the master's start -----------------------------------------------------------------------------------------------


def test_its_start_is_waited_for() -> None:
    """That it answers its own API, not that its port is open."""
    codes = iter((0, -1, 1))
    with SimpleXMLRPCServer(("127.0.0.1", 0), logRequests=False) as server:
        server.register_function(lambda _caller: [1, "", 42], "getPid")
        server.register_function(lambda _caller: [next(codes), "", [[], [], []]], "getSystemState")
        threading.Thread(target=server.serve_forever).start()
        code = master.PROBE.replace("11311", str(server.server_address[1]))
        try:
            waited = subprocess.run(["sh", "-c", master.UNTIL, code], capture_output=True, check=False, timeout=60)  # noqa: S603, S607
        finally:
            server.shutdown()
    assert (waited.returncode, waited.stderr, next(codes, None)) == (0, b"", None)
