# SPDX-License-Identifier: GPL-3.0-or-later
"""Every file is in its room, imports go downward only, and what runs on hosts and in pods can run there."""

from __future__ import annotations

from pathlib import Path

import pytest
import rooms
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.pod_code import pod_files
from pod_code import modules

PLUGINS = Path(__file__).resolve().parents[2] / "plugins"
FULL = "ansible_collections.rosops.fleet.plugins"


def test_the_collection_keeps_to_its_rooms() -> None:
    assert rooms.wrongs(PLUGINS) == []


@pytest.mark.parametrize("table", [rooms.HOST_ROOMS, rooms.CONTROL_ROOMS])
def test_rooms_stand_on_those_that_were_named_before_them(table: dict[str, tuple[str, ...]]) -> None:
    names = list(table)
    for room, below in table.items():
        assert set(below) <= set(names[: names.index(room)]), room


def test_what_goes_into_pods() -> None:
    assert {name.partition(".")[0] for name in [*modules(), *pod_files()]} == {"run", "code", *rooms.POD_ROOMS}


WRONG = {
    "a room on one that is above it, in a function": (
        {"module_utils/_common/poll.py": "def f():\n    from .._ros import gate\n"},
        "plugins/module_utils/_common/poll.py: imports plugins.module_utils._ros.gate; _common stands on nothing",
    ),
    "two that do not know each other": (
        {"module_utils/_host/k3s.py": "from .._exporter.exporter import say\n"},
        "plugins/module_utils/_host/k3s.py: imports plugins.module_utils._exporter.exporter.say; "
        "_host stands on _common _ros _step",
    ),
    "upward on the control node": (
        {"plugin_utils/_kube/watch.py": f"from {FULL}.plugin_utils._update.plan import Step\n"},
        "plugins/plugin_utils/_kube/watch.py: imports plugins.plugin_utils._update.plan.Step; _kube stands on ",
    ),
    "a host on the control node": (
        {"module_utils/_host/k3s.py": "from ...plugin_utils._model.names import label\n"},
        "plugins/module_utils/_host/k3s.py: imports plugins.plugin_utils._model.names.label; "
        "plugin_utils stays on the control node",
    ),
    "a module on the control node": (
        {"modules/ros_ready.py": f"import {FULL}.plugin_utils._k3s.plan\n"},
        "plugins/modules/ros_ready.py: imports plugins.plugin_utils._k3s.plan; plugin_utils stays on the control node",
    ),
    "a plugin from below": (
        {"plugin_utils/_report/run.py": f"from {FULL}.callback.fleet_report import CallbackModule\n"},
        "plugins/plugin_utils/_report/run.py: imports plugins.callback.fleet_report.CallbackModule; "
        "nothing imports callback",
    ),
    "an absolute name for pods": (
        {"module_utils/_ros/gate.py": f"from {FULL}.module_utils._common.errors import RosError\n"},
        f"plugins/module_utils/_ros/gate.py: imports {FULL}.module_utils._common.errors; "
        "by that name it is not found in a pod: import it relatively",
    ),
    "Ansible in a pod": (
        {"module_utils/_pod/stop.py": "from ansible.module_utils.basic import AnsibleModule\n"},
        "plugins/module_utils/_pod/stop.py: imports ansible.module_utils.basic; there is no Ansible in a pod",
    ),
    "Ansible's control node on a host": (
        {"modules/ros_ready.py": "from ansible.errors import AnsibleError\n"},
        "plugins/modules/ros_ready.py: imports ansible.errors; only ansible.module_utils goes to hosts",
    ),
    "a library on a host": (
        {"module_utils/_host/facts.py": "import yaml\n"},
        "plugins/module_utils/_host/facts.py: imports yaml; hosts have the standard library alone",
    ),
    "a newer language": (
        {"module_utils/_ros/graph.py": "match 1:\n    case _:\n        pass\n"},
        "plugins/module_utils/_ros/graph.py:3: not of Python 3.8: ",
    ),
    "a file on the stairs": (
        {"plugin_utils/plan.py": ""},
        "plugins/plugin_utils/plan.py: lies in no room of plugin_utils; they are _upstream _model ",
    ),
    "a room that is not planned": (
        {"module_utils/_misc/things.py": ""},
        "plugins/module_utils/_misc/things.py: lies in no room of module_utils; they are _common ",
    ),
    "an underscore too many": (
        {"plugin_utils/_update/_plan.py": ""},
        "plugins/plugin_utils/_update/_plan.py: a file is named by a plain noun",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_file_on_the_wrong_floor_is_found(tmp_path: Path, case: str) -> None:
    files, said = WRONG[case]
    for name, text in files.items():
        path = tmp_path / "plugins" / name
        path.parent.mkdir(parents=True)
        path.write_text(text, "utf-8")
    [found] = rooms.wrongs(tmp_path / "plugins")
    assert found.startswith(said)
