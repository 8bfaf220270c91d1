# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Versions of k3s: which texts are some, and which is newer."""

from __future__ import annotations

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.versions import version

# each is newer than the one before it
IN_ORDER = ("v1.9.9+k3s1", "v1.34.2-rc1+k3s1", "v1.34.2-rc10+k3s1", "v1.34.2+k3s1", "v1.34.2+k3s10", "v1.35.0+k3s1")


def test_their_order() -> None:
    known = [found for found in map(version, IN_ORDER) if found]
    assert len(known) == len(IN_ORDER)
    for number, one in enumerate(known):
        assert [one.newer_than(other) for other in known] == [number > place for place in range(len(known))]


def test_builds_of_two_vendors_are_of_one_age() -> None:
    ours, theirs = version("v1.34.2+lab2"), version("v1.34.2+k3s1")
    assert ours
    assert theirs
    assert not (ours.newer_than(theirs) or theirs.newer_than(ours))


@pytest.mark.parametrize("text", ["", "1.34.2", "v1.34", "v1.34.2 ", "v1.34.2+k3s1-dirty"])
def test_a_text_that_is_no_version(text: str) -> None:
    assert version(text) is None
