# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which way from one version of k3s to another is allowed."""

from __future__ import annotations

from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._k3s.upgrade import (
    INSTALL,
    NOTHING,
    REFUSED,
    RESTART,
    Verdict,
    verdict,
)

NOW = "v1.34.2+k3s1"


@pytest.mark.parametrize(
    ("installed", "wanted", "more", "word", "words"),
    [
        ("", NOW, {}, INSTALL, ""),
        (NOW, NOW, {"changed": False}, NOTHING, ""),
        (NOW, "", {"changed": False}, NOTHING, ""),
        (NOW, "", {}, RESTART, ""),
        (NOW, NOW, {}, RESTART, ""),
        (NOW, "v1.34.3+k3s1", {}, RESTART, ""),
        (NOW, "v1.34.2+k3s2", {}, RESTART, ""),
        ("v1.34.2-rc1+k3s1", NOW, {}, RESTART, ""),
        ("v1.34.2+k3s1", "v1.34.2+lab1", {}, RESTART, ""),
        ("a build of our own", NOW, {}, RESTART, ""),
        (NOW, "v1.34.1+k3s1", {}, REFUSED, "k3s v1.34.1+k3s1 is older than v1.34.2+k3s1, which runs there"),
        ("v1.35.0+k3s1", NOW, {}, REFUSED, "is older than v1.35.0+k3s1"),
        ("v1.34.2+k3s2", NOW, {}, REFUSED, "is older than"),
        (NOW, "v1.34.2-rc1+k3s1", {}, REFUSED, "is older than"),
        ("v1.34.2+k3s10", "v1.34.2+k3s9", {}, REFUSED, "is older than"),
        ("v1.31.1+k3s1", NOW, {}, REFUSED, "a minor version is skipped"),
        ("v1.31.1+k3s1", NOW, {}, REFUSED, "Go to a version v1.32.x first"),
        # what nobody has proven is left as it came
        ("v1.34.3+k3s1", NOW, {"back_to": NOW}, RESTART, ""),
        ("v1.34.3+k3s1", "v1.34.1+k3s1", {"back_to": NOW}, REFUSED, "is older than"),
        # an agent
        (NOW, "v1.34.3+k3s1", {"servers": ["v1.34.3+k3s1"]}, RESTART, ""),
        (NOW, "v1.34.3+k3s1", {"servers": ["v1.34.3+k3s1", NOW]}, REFUSED, "newer than its cluster's servers (v1.34.2"),
        ("", NOW, {"servers": ["v1.33.5+k3s1"]}, REFUSED, "Bring the servers to that version first"),
        ("", NOW, {"servers": ["of our own"]}, INSTALL, ""),
    ],
)
def test_verdicts(installed: str, wanted: str, more: dict[str, Any], word: str, words: str) -> None:
    found = verdict(installed, wanted, **{"changed": True, **more})
    assert found.word == word
    assert words in found.reason
    assert bool(found.reason) == (word == REFUSED)


@pytest.mark.parametrize(
    ("installed", "wanted", "restarts"),
    [("v1.30.9+k3s1", "v1.31.0+k3s1", True), (NOW, "v1.34.9+k3s1", False), (NOW, "", False), ("ours", NOW, False)],
)
def test_another_minor_version_may_start_all_containers_again(installed: str, wanted: str, restarts: bool) -> None:
    assert verdict(installed, wanted, changed=True) == Verdict(RESTART, restarts_pods=restarts)
