# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""A claim on a robot: what is confirmed of it, by a clock that goes on while the machine sleeps."""

from __future__ import annotations

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import KubeError
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.lease import Hold
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.cluster import LEASE_SECONDS, _Claim
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.world import LostError


class Lease:
    def __init__(self) -> None:
        self.found: Hold | None = Hold(True, "us")
        self.renewed = 0

    def renew(self) -> Hold:
        self.renewed += 1
        if self.found is None:
            raise KubeError("the API cannot be reached")
        return self.found


def claim(lease: Lease, times: list[float]) -> _Claim:
    return _Claim(lease, lambda: times[0])  # type: ignore[arg-type]


def test_within_its_time_nobody_else_can_have_it() -> None:
    lease, times = Lease(), [0.0]
    mine = claim(lease, times)
    lease.found, times[0] = Hold(False, "other", "noon"), LEASE_SECONDS - 1.0
    mine.confirm()
    assert lease.renewed == 0


def test_after_its_time_the_api_says_whose_it_is() -> None:
    lease, times = Lease(), [0.0]
    mine = claim(lease, times)
    times[0] = float(LEASE_SECONDS)
    mine.confirm()  # nobody wanted it
    lease.found, times[0] = None, 2.0 * LEASE_SECONDS
    with pytest.raises(KubeError):
        mine.confirm()
    lease.found = Hold(False, "laptop, process 7", "noon")
    with pytest.raises(LostError, match="laptop, process 7 has this robot since noon"):
        mine.confirm()
    lease.found = Hold(True, "us")
    with pytest.raises(LostError):  # what was lost once stays lost
        mine.confirm()


def test_one_that_was_taken_and_let_go_is_lost() -> None:
    lease, times = Lease(), [0.0]
    mine = claim(lease, times)
    lease.found, times[0] = Hold(False, ""), 600.0
    with pytest.raises(LostError, match="another one had this robot"):
        mine.confirm()
