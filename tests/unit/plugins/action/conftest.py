# SPDX-License-Identifier: GPL-3.0-or-later
"""The options that lead to the API server of the tests, and a place for what a run writes down."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest
from ansible import constants as C  # noqa: N812 - its customary name
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.access import Identity
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._kube.kube_server import Server


@pytest.fixture(autouse=True)
def local_tmp(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(C, "DEFAULT_LOCAL_TMP", str(tmp_path))


@pytest.fixture
def api(server: Server, monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """The options that lead to it; it is the cluster `edge` of the fleet `production`."""
    server.put("/api/v1/namespaces/kube-system/configmaps/rosops-fleet", Identity("production", "edge").as_object())
    monkeypatch.setattr(os, "environ", dict(os.environ))  # an action adds its task's environment to the process'
    return {"host": server.url, "api_key": "t"}
