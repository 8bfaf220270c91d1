# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Whose cluster it is."""

from __future__ import annotations

from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.identity import (
    Identity,
    WrongClusterError,
    identity_in,
    to_be_adopted,
)

EDGE = Identity("production", "edge")
WHERE = "https://10.0.0.1:6443 (from K8S_AUTH_HOST of the environment)"


@pytest.mark.parametrize(
    ("found", "own", "adopted"),
    [
        (EDGE, False, False),
        (EDGE, True, False),
        (None, True, True),
        (Identity("fleet", "edge"), True, True),  # made before the fleet had a name
    ],
)
def test_the_right_one(found: Identity | None, own: bool, adopted: bool) -> None:
    assert to_be_adopted(found, EDGE, own, WHERE) is adopted


@pytest.mark.parametrize(
    ("found", "own", "said"),
    [
        (Identity("staging", "edge"), False, "the cluster edge of the fleet staging"),
        (Identity("staging", "edge"), True, "the cluster edge of the fleet staging"),
        (Identity("production", "robot2"), False, "the cluster robot2 of the fleet production"),
        (Identity("fleet", "robot2"), True, "the cluster robot2 of the fleet fleet"),
        (Identity("fleet", "edge"), False, "the cluster edge of the fleet fleet"),
        (None, False, "a cluster that carries no fleet's identity"),
    ],
)
def test_another_one_is_refused_with_both_names(found: Identity | None, own: bool, said: str) -> None:
    with pytest.raises(WrongClusterError) as error:
        to_be_adopted(found, EDGE, own, WHERE)
    assert str(error.value).startswith(
        f"{WHERE} leads to {said}; the inventory's is {EDGE}. Nothing was read or changed."
    )


def test_what_is_written_is_what_is_read_where_there_is_one() -> None:
    assert identity_in(EDGE.as_object()) == EDGE
    nothing: list[Any] = [None, {}, {"data": None}, {"data": {"fleet": "a"}}]
    assert [identity_in(found) for found in nothing] == [None] * 4
