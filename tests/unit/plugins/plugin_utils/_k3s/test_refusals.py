# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What cannot be mended on a host."""

from __future__ import annotations

from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._k3s.refusals import refusals

NOW: dict[str, Any] = {
    "machine": "x86_64",
    "other_service": False,
    "cgroup_refused": False,
    "version": "v1.34.2+k3s1",
    "change": {"unproven": False, "version": ""},
    "tokens": {"server": "same", "agent": "same"},
}
VARIABLES: dict[str, Any] = {
    "k3s_role": "server",
    "k3s_cluster": "edge",
    "k3s_server_hosts": ["edge1"],
    "k3s_install_source": "release",
    "k3s_version": "v1.34.2+k3s1",
    "k3s_airgap_dir": "",
}


def test_a_sound_host_is_not_refused() -> None:
    assert list(refusals(NOW, VARIABLES, "edge1")) == []


@pytest.mark.parametrize(
    ("now", "variables", "words"),
    [
        ({"tokens": {"server": "differs", "agent": "same"}}, {}, "k3s_token is not the token that the cluster edge"),
        ({"tokens": {"server": "same", "agent": "differs"}}, {}, "k3s_agent_token is not the agents' token"),
        ({"tokens": {"server": "lost", "agent": "same"}}, {}, "not that cluster's tokens in /etc/rancher/k3s"),
        ({"other_service": True}, {}, "It is a k3s agent and is to become a server"),
        ({}, {"k3s_server_hosts": ["edge2", "edge3"]}, "k3s_role is server, but k3s_server_hosts is edge2, edge3"),
        ({}, {"k3s_install_source": "airgap"}, "needs k3s_airgap_dir"),
        ({"version": "v1.35.0+k3s1"}, {}, "k3s v1.34.2+k3s1 is older than v1.35.0+k3s1"),
        ({"version": "v1.31.1+k3s1"}, {}, "a minor version is skipped"),
        ({"version": "v1.35.0+k3s1", "change": {"unproven": False, "version": "v1.34.2+k3s1"}}, {}, "is older than"),
        ({"cgroup_refused": True}, {"k3s_version": "v1.35.5+k3s1"}, "which has cgroup v1"),
        ({"machine": "riscv64"}, {}, "no k3s for the architecture riscv64"),
    ],
)
def test_each_is_named(now: dict[str, Any], variables: dict[str, Any], words: str) -> None:
    (found,) = refusals({**NOW, **now}, {**VARIABLES, **variables}, "edge1")
    assert words in found


@pytest.mark.parametrize(
    ("now", "variables"),
    [
        ({"version": "v1.35.0+k3s1", "change": {"unproven": True, "version": "v1.34.2+k3s1"}}, {}),
        ({"version": "v1.35.0+k3s1"}, {"k3s_install_source": "airgap", "k3s_airgap_dir": "/srv"}),
    ],
)
def test_the_way_back_from_what_nobody_has_proven_is_open(now: dict[str, Any], variables: dict[str, Any]) -> None:
    assert list(refusals({**NOW, **now}, {**VARIABLES, **variables}, "edge1")) == []


def test_all_are_found_at_once() -> None:
    assert len(list(refusals({**NOW, "machine": "vax", "other_service": True}, VARIABLES, "edge1"))) == 2
