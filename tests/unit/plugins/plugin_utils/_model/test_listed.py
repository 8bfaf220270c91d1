# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Lists as surveys answer them."""

from __future__ import annotations

from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.listed import listed, wrong_waves


@pytest.mark.parametrize(
    ("given", "meant"),
    [
        (None, []),
        ("", []),
        ("  \n", []),
        ([], []),
        (["a", 1], ["a", 1]),
        (("a",), ["a"]),
        (1, [1]),
        ("50%", ["50%"]),
        ("camera", ["camera"]),
        ("camera, lidar", ["camera", "lidar"]),
        ("camera\nlidar\n", ["camera", "lidar"]),
        ("1 25% 100%", ["1", "25%", "100%"]),
        ("[camera, lidar]", ["camera", "lidar"]),
        ('[1, "25%"]', [1, "25%"]),
        ("[]", []),
    ],
)
def test_what_was_meant(given: Any, meant: list[Any]) -> None:
    assert [str(one) for one in listed(given)] == [str(one) for one in meant]


@pytest.mark.parametrize("given", ["[a, b", "[a]: b", "[a] b"])
def test_what_begins_as_a_list_has_to_be_one(given: str) -> None:
    with pytest.raises(SpecError, match="is no list; allowed: a list, or words with commas"):
        listed(given)


@pytest.mark.parametrize("waves", [None, "", 1, "1", "100%", [1, "25%", "100%"], "[1, 25%, 100%]", "1, 050%"])
def test_waves_that_ansible_can_make(waves: Any) -> None:
    assert wrong_waves(waves) == ""


@pytest.mark.parametrize(
    ("waves", "wrong"),
    [
        ("all", "has 'all'"),
        ("0", "has '0'"),
        ([0], "has 0"),
        ("0%", "has '0%'"),
        ("101%", "has '101%'"),
        ("-1", "has '-1'"),
        ([True], "has True"),
        ([1.5], "has 1.5"),
        ("1, half", "has 'half'"),
        ("[1", "'[1' is no list"),
    ],
)
def test_waves_that_it_would_stumble_over(waves: Any, wrong: str) -> None:
    assert wrong_waves(waves).startswith(wrong)
