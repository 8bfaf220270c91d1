# SPDX-License-Identifier: GPL-3.0-or-later
"""The control node, and the API server of the cluster that its fleet has."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.access import Identity
from ansible_collections.rosops.fleet.tests.unit.playbooks.control_node import IDENTITY, SSH, Control
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._kube.kube_server import Server


@pytest.fixture
def server() -> Iterator[Server]:
    made = Server()
    made.put(IDENTITY, Identity("production", "edge").as_object())
    yield made
    made.stop()


@pytest.fixture
def control(tmp_path: Path, server: Server) -> Iterator[Control]:
    made = Control(tmp_path, server)
    robot3_is_off = SSH.format(folder=tmp_path).replace("= 192.0.2.1 ]", "= 192.0.2.1 -o $host = 192.0.2.13 ]")
    made.write("ssh", robot3_is_off, 0o755)
    yield made
    made.end()
