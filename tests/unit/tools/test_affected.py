# SPDX-License-Identifier: GPL-3.0-or-later
"""Which unit tests `make check` runs."""

from __future__ import annotations

import affected
import pytest

FULL = "ansible_collections.rosops.fleet"
TESTS = {
    "graph": "tests/unit/plugins/module_utils/_ros/test_graph.py",
    "gate": "tests/unit/plugins/module_utils/_ros/test_gate.py",
    "ready": "tests/unit/plugins/modules/test_ros_ready.py",
    "hosts": "tests/unit/lab/test_hosts.py",
    "roles": "tests/unit/test_role_specs.py",
}
FILES = {
    "plugins/module_utils/_ros/graph.py": "import os\n",
    "plugins/module_utils/_ros/gate.py": "def f():\n    from . import graph\n",
    "plugins/module_utils/_pod/judge.py": "from .._ros.gate import look\n",
    "plugins/modules/ros_ready.py": f"from {FULL}.plugins.module_utils._pod.judge import Judge\n",
    "tests/lab/lablib/hosts.py": "from .run import run\n",
    "tests/lab/lablib/run.py": "",
    "tests/unit/lab/conftest.py": "",
    "tests/update/test_1_fleet.py": f"from {FULL}.plugins.module_utils._ros import graph\n",
    TESTS["graph"]: f"from {FULL}.plugins.module_utils._ros.graph import Graph\n",
    TESTS["gate"]: f"from {FULL}.plugins.module_utils._ros import gate\n",
    TESTS["ready"]: f"import {FULL}.plugins.modules.ros_ready\n",
    TESTS["hosts"]: "from lablib.hosts import Host\n",
    TESTS["roles"]: 'ROLES = "../roles/node"\n',
}


@pytest.mark.parametrize(
    ("changed", "tests"),
    [
        ("plugins/module_utils/_ros/graph.py", ["graph", "gate"]),
        ("plugins/module_utils/_ros/gate.py", ["gate"]),
        ("plugins/module_utils/_pod/judge.py", ["ready"]),
        (TESTS["ready"], ["ready"]),
        ("tests/lab/lablib/run.py", ["hosts"]),
        ("tests/unit/lab/conftest.py", ["hosts"]),
        ("roles/node/tasks/main.yml", ["roles"]),
        ("roles/k3s/tasks/main.yml", ["roles"]),
        ("docs/updates.md", []),
        ("tests/update/test_1_fleet.py", []),
        ("plugins/module_utils/_ros/was_removed.py", []),
    ],
)
def test_the_nearest_tests_come_first(changed: str, tests: list[str]) -> None:
    assert affected.near([changed], FILES) == [TESTS[name] for name in tests]


def test_where_none_is_near_the_nearest_are_taken() -> None:
    files = {name: text for name, text in FILES.items() if name not in (TESTS["graph"], TESTS["gate"])}
    assert affected.near(["plugins/module_utils/_ros/graph.py"], files) == [TESTS["ready"]]
