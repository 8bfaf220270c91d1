# SPDX-License-Identifier: GPL-3.0-or-later
"""An API server in this process, and a client of it that loses no time."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.client import Kube
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._kube.kube_server import Clock, Server


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def said() -> list[str]:
    return []


@pytest.fixture
def kube(server: Server, clock: Clock, said: list[str]) -> Iterator[Kube]:
    auth = {"host": server.url, "api_key": "secret-token"}
    with Kube(auth, say=said.append, now=clock.now, sleep=clock.sleep) as made:
        yield made
