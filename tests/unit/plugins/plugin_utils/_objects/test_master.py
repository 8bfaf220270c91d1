# SPDX-License-Identifier: GPL-3.0-or-later
"""The ROS master, the keeper and the exporter: beside each other, and what each is asked."""

from __future__ import annotations

import subprocess
import sys
import threading
from collections.abc import Iterator
from typing import Any
from xmlrpc.server import SimpleXMLRPCServer

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._exporter import main as exporter_main
from ansible_collections.rosops.fleet.plugins.module_utils._exporter import updates
from ansible_collections.rosops.fleet.plugins.module_utils._robot import main as keeper_main
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects import master
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.exporter import exporter_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.namespace import namespace_objects
from ansible_collections.rosops.fleet.tests.unit.robots import robot

Object = dict[str, Any]
VOLUMES = [{"name": "a", "size": "1Ki"}]


def placed(objects: list[Object]) -> list[tuple[str, str, str]]:
    return [(one["kind"], one["metadata"].get("namespace", ""), one["metadata"]["name"]) for one in objects]


def pod(deployment: Object) -> Object:
    spec: Object = deployment["spec"]["template"]["spec"]
    return spec


def keeper(**of: Any) -> list[Object]:
    return master.keeper_objects(robot(name="r1", master=of))


def exporter(code: Any = None, volumes: Any = (), **options: Any) -> list[Object]:
    return exporter_objects(robot(name="r1", volumes=volumes), code or {"run.py": "code"}, **options)


@pytest.mark.parametrize("mode", ["robot", "shared"])
def test_each_is_where_the_master_is_and_its_account_is_there_before(mode: str) -> None:
    """A pod without its account is not made; the namespace is applied before everything else of a robot."""
    made = robot(name="r1", master={"mode": mode, "image": "ros:x"})
    own, _service, kept, _service = master.master_objects(made)
    config, beside = exporter_objects(made, {})
    assert {one["metadata"]["namespace"] for one in (own, kept, config, beside)} == {
        "fleet" if mode == "shared" else "robot-r1"
    }
    for one in (kept, beside):
        assert pod(one)["nodeSelector"] == pod(own)["nodeSelector"]
        assert pod(one)["containers"][0]["image"] == "ros:x"
    account = ("ServiceAccount", kept["metadata"]["namespace"], pod(kept)["serviceAccountName"])
    first, *objects = placed(namespace_objects(made))
    assert (first[0], account in objects, pod(kept)["automountServiceAccountToken"]) == ("Namespace", True, True)
    spaces = {first[2], *(name for kind, _space, name in objects if kind == "Namespace")}
    assert {space for _kind, space, _name in objects} - {""} <= spaces


def test_the_masters_overrides_are_not_the_keepers() -> None:
    """Nor does a change of the master restart it: it is there to outlive that."""
    overrides = {"spec": {"template": {"spec": {"hostNetwork": True}}}}
    assert keeper(overrides=overrides) == keeper()
    both = master.master_objects(robot(name="r1", master={"overrides": overrides}))
    kinds, names = ["Deployment", "Service"] * 2, ["ros-master"] * 2 + ["ros-keeper"] * 2
    assert [(kind, name) for kind, _space, name in placed(both)] == list(zip(kinds, names))
    assert "hostNetwork" in pod(both[0])


def test_goal_forwarding_is_switched_off_by_a_word_of_its_command() -> None:
    on, off = (pod(keeper(goal_forwarding=word)[0])["containers"][0] for word in (True, False))
    assert on == pod(keeper()[0])["containers"][0]
    assert off == {**on, "command": [*on["command"], "--goal-forwarding", "off"]}
    words = off["command"][off["command"].index("keeper") + 1 :]
    assert keeper_main.options(words)["--goal-forwarding"] == "off"


# --- the exporter -----------------------------------------------------------------------------------------------------


def test_newer_code_restarts_it() -> None:
    first, again, newer = (exporter(code)[1]["spec"]["template"] for code in (None, None, {"run.py": "newer"}))
    assert (again == first, newer == first) == (True, False)


@pytest.mark.parametrize("given", [{}, {"claims": True}])
def test_the_process_knows_its_options(given: dict[str, bool]) -> None:
    container = pod(exporter(volumes=VOLUMES, **given)[1])["containers"][0]
    chosen = exporter_main.options(container["args"])
    assert set(chosen) == set(exporter_main.OPTIONS)
    assert (chosen["--capacities"] == '{"a-pvc": 1024}') is given.get("claims", False)
    where = next(mount["mountPath"] for mount in container["volumeMounts"] if mount["name"] == "updates")
    assert f"{where}/updates.json" == updates.FILE


def test_no_claims_no_host_path() -> None:
    assert [volume["name"] for volume in pod(exporter(claims=True)[1])["volumes"]] == ["code", "updates"]


# --- the master's start -----------------------------------------------------------------------------------------------


@pytest.fixture
def api_port(request: pytest.FixtureRequest) -> Iterator[int]:
    """A stand-in for the master's XML-RPC API; `request.param` has the codes of getSystemState, a call each."""
    codes = iter(request.param)
    with SimpleXMLRPCServer(("127.0.0.1", 0), logRequests=False) as server:
        server.register_function(lambda _caller: [1, "", 42], "getPid")
        server.register_function(lambda _caller: [next(codes), "", [[], [], []]], "getSystemState")
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield server.server_address[1]
        server.shutdown()
        thread.join()


def probe(port: int) -> int:
    code = master.PROBE.replace("11311", str(port))
    return subprocess.run([sys.executable, "-c", code], capture_output=True, check=False).returncode  # noqa: S603


@pytest.mark.parametrize(("api_port", "status"), [([1], 0), ([0], 1), ([-1], 1)], indirect=["api_port"])
def test_its_probe_asks_the_api(api_port: int, status: int) -> None:
    assert probe(api_port) == status
    assert probe(1) != 0  # nobody listens there


@pytest.mark.parametrize("api_port", [[0, -1, 1]], indirect=True)
def test_its_start_is_waited_for(api_port: int) -> None:
    code = master.PROBE.replace("11311", str(api_port))
    waited = subprocess.run(["sh", "-c", master.UNTIL, code], capture_output=True, check=False, timeout=60)  # noqa: S603, S607
    assert (waited.returncode, waited.stderr) == (0, b"")
