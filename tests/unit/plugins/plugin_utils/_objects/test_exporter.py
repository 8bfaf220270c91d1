# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The exporter's ConfigMap and Deployment, against golden files and against what they must agree with."""

from __future__ import annotations

from typing import Any

import pytest
import yaml
from ansible_collections.rosops.fleet.plugins.module_utils._exporter import updates as _exporter_updates
from ansible_collections.rosops.fleet.plugins.module_utils._exporter.main import OPTIONS, options
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.exporter import ExporterOptions, exporter_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.master import ros_core_objects
from ansible_collections.rosops.fleet.tests.unit.golden import regenerate_exporter as golden
from ansible_collections.rosops.fleet.tests.unit.robots import robot

CODE = {"run.py": "code"}


def objects(options: ExporterOptions | None = None, code: Any = None, **more: Any) -> Any:
    return exporter_objects(robot(name="r1", **more), code or CODE, options or ExporterOptions())


@pytest.mark.parametrize("name", sorted(golden.CASES))
def test_golden(name: str) -> None:
    """After a change that is meant: tests/unit/golden/regenerate_exporter.py."""
    expected = yaml.safe_load((golden.FILES / f"{name}.yml").read_text("utf-8"))
    assert golden.golden(name) == expected


@pytest.mark.parametrize("mode", ["robot", "shared"])
def test_beside_its_master(mode: str) -> None:
    config, deployment = objects(master={"mode": mode, "image": "ros:x"})
    master = ros_core_objects(robot(name="r1", master={"mode": mode, "image": "ros:x"}))[0]
    pod, masters = deployment["spec"]["template"]["spec"], master["spec"]["template"]["spec"]
    assert config["metadata"]["namespace"] == deployment["metadata"]["namespace"] == master["metadata"]["namespace"]
    assert pod["nodeSelector"] == masters["nodeSelector"]
    assert pod["containers"][0]["image"] == "ros:x"


def test_a_shared_masters_are_the_same_from_every_robot() -> None:
    shared = {"mode": "shared"}
    looks = ExporterOptions(claims_path="/s")
    one = objects(looks, master=shared, volumes=[{"name": "a"}])
    other = exporter_objects(robot(name="r2", master=shared), CODE, looks)
    assert one == other


def test_newer_code_restarts_it() -> None:
    def template(*made: Any) -> Any:
        return made[0][1]["spec"]["template"]

    first = template(objects())
    assert template(objects()) == first
    assert template(objects(code={"run.py": "newer"})) != first


@pytest.mark.parametrize(
    "given", [{}, {"interval": 5, "timeout": 1.5, "statistics": True, "claims_path": "/s"}, {"claims_path": "/s"}]
)
def test_the_process_knows_its_options(given: dict[str, Any]) -> None:
    wanted = ExporterOptions(**given)
    pod = objects(wanted, volumes=[{"name": "a", "size": "1Ki"}])[1]["spec"]["template"]["spec"]
    chosen = options(pod["containers"][0]["args"])
    assert set(chosen) == set(OPTIONS)
    assert float(chosen["--interval"]) == wanted.interval
    assert (chosen["--statistics"] == "on") is wanted.statistics
    assert (chosen["--capacities"] == '{"a-pvc": 1024}') is bool(wanted.claims_path)


def test_no_claims_no_host_path() -> None:
    volumes = objects(ExporterOptions(claims_path="/s"))[1]["spec"]["template"]["spec"]["volumes"]
    assert [volume["name"] for volume in volumes] == ["code", "updates"]


def test_the_updates_are_where_the_process_looks() -> None:
    mounts = objects()[1]["spec"]["template"]["spec"]["containers"][0]["volumeMounts"]
    where = next(mount["mountPath"] for mount in mounts if mount["name"] == "updates")
    assert f"{where}/updates.json" == _exporter_updates.FILE
