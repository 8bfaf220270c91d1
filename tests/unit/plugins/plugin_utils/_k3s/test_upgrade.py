# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which way from one version of k3s to another is allowed."""

from __future__ import annotations

from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._k3s.upgrade import refusal, restarts_pods

NOW = "v1.34.2+k3s1"


@pytest.mark.parametrize(
    ("installed", "wanted", "more", "words"),
    [
        ("", NOW, {}, ""),
        (NOW, "", {}, ""),
        (NOW, NOW, {}, ""),
        (NOW, "v1.34.3+k3s1", {}, ""),
        (NOW, "v1.34.2+k3s2", {}, ""),
        ("v1.34.2-rc1+k3s1", NOW, {}, ""),
        ("v1.34.2+k3s1", "v1.34.2+lab1", {}, ""),
        ("a build of our own", NOW, {}, ""),
        (NOW, "v1.34.1+k3s1", {}, "k3s v1.34.1+k3s1 is older than v1.34.2+k3s1, which runs there"),
        ("v1.35.0+k3s1", NOW, {}, "is older than v1.35.0+k3s1"),
        ("v1.34.2+k3s2", NOW, {}, "is older than"),
        (NOW, "v1.34.2-rc1+k3s1", {}, "is older than"),
        ("v1.34.2+k3s10", "v1.34.2+k3s9", {}, "is older than"),
        ("v1.31.1+k3s1", NOW, {}, "a minor version is skipped"),
        ("v1.31.1+k3s1", NOW, {}, "Go to a version v1.32.x first"),
        # what nobody has proven is left as it came
        ("v1.34.3+k3s1", NOW, {"back_to": NOW}, ""),
        ("v1.34.3+k3s1", "v1.34.1+k3s1", {"back_to": NOW}, "is older than"),
        # an agent
        (NOW, "v1.34.3+k3s1", {"servers": ["v1.34.3+k3s1"]}, ""),
        (NOW, "v1.34.3+k3s1", {"servers": ["v1.34.3+k3s1", NOW]}, "newer than its cluster's servers (v1.34.2"),
        ("", NOW, {"servers": ["v1.33.5+k3s1"]}, "Bring the servers to that version first"),
        ("", NOW, {"servers": ["of our own"]}, ""),
        # a host with cgroup v1
        (NOW, "v1.34.3+k3s1", {"cgroup_refused": True}, ""),
        (NOW, "v1.35.5+k3s1", {"cgroup_refused": True}, "k3s v1.35.5+k3s1 does not start on this host"),
        ("", "v1.35.5+k3s1", {"cgroup_refused": True}, "systemd.unified_cgroup_hierarchy=1"),
        ("v1.35.4+k3s1", "v1.35.5+k3s1", {"cgroup_refused": True}, ""),
        (NOW, "v1.35.5+k3s1", {}, ""),
        (NOW, "", {"cgroup_refused": True}, ""),
    ],
)
def test_refusals(installed: str, wanted: str, more: dict[str, Any], words: str) -> None:
    found = refusal(installed, wanted, **more)
    assert words in found
    assert bool(found) is bool(words)


@pytest.mark.parametrize(
    ("installed", "wanted", "restarts"),
    [("v1.30.9+k3s1", "v1.31.0+k3s1", True), (NOW, "v1.34.9+k3s1", False), (NOW, "", False), ("ours", NOW, False)],
)
def test_another_minor_version_may_start_all_containers_again(installed: str, wanted: str, restarts: bool) -> None:
    assert restarts_pods(installed, wanted) is restarts
