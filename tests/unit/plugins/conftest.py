# SPDX-License-Identifier: GPL-3.0-or-later
"""The API server that tests of clients and actions ask, and peers of a ROS graph."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from ansible_collections.rosops.fleet.tests.unit.plugins.fake_ros import Peers
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._kube.kube_server import Server


@pytest.fixture
def server() -> Iterator[Server]:
    made = Server()
    yield made
    made.stop()


@pytest.fixture
def peers() -> Iterator[Peers]:
    made = Peers()
    yield made
    made.close()
