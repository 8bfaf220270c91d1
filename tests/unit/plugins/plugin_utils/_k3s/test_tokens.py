# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which tokens a host keeps, and which are refused."""

from __future__ import annotations

import base64
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.plugin_utils._k3s.tokens import tokens_to_keep

FULL = f"K10{'a' * 64}::node:s3cret"
AWAY = {"unreachable": True, "item": ["edge1", "agent-token"]}
GIVEN = {
    "source": "/var/lib/rancher/k3s/server/agent-token",
    "content": base64.b64encode(f"{FULL}\n".encode()).decode(),
}
READ = [AWAY, GIVEN]


def variables(token: str = "", agent: str = "") -> dict[str, Any]:
    return {"k3s_cluster": "edge", "k3s_token": token, "k3s_agent_token": agent}


@pytest.mark.parametrize("given", ["", "s3cret", FULL])
def test_a_member_keeps_the_clusters_full_token(given: str) -> None:
    assert tokens_to_keep(["agent-token"], READ, variables("unread", given)) == {"agent-token": FULL}


def test_one_that_is_not_the_clusters_is_refused_and_not_shown() -> None:
    with pytest.raises(SpecError, match=r"^k3s_agent_token is not the one that the cluster edge runs with") as caught:
        tokens_to_keep(["agent-token"], READ, variables("", "0ther"))
    assert "0ther" not in str(caught.value)


def test_a_new_cluster_takes_the_inventorys_or_makes_its_own() -> None:
    names = ["token", "agent-token"]
    first, second = (tokens_to_keep(names, [], variables("", "given")) for _run in range(2))
    assert first["agent-token"] == "given"
    assert len(first["token"]) == 48
    assert first["token"].isalnum()
    assert first["token"] != second["token"]
