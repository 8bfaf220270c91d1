# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The API server of the cluster that the control node's fleet has."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.identity import Identity
from ansible_collections.rosops.fleet.tests.unit.playbooks.control_node import IDENTITY
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._kube.kube_server import Server


@pytest.fixture
def server() -> Iterator[Server]:
    made = Server()
    made.put(IDENTITY, Identity("production", "edge").as_object())
    yield made
    made.stop()
