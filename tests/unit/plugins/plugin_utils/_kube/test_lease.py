# SPDX-License-Identifier: GPL-3.0-or-later
"""The Lease: one holder at a time, whatever the clocks say."""

from __future__ import annotations

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.client import Kube
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.connection import ApiError
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.lease import Lease
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._kube.kube_server import Clock, Server

PATH = "/apis/coordination.k8s.io/v1/namespaces/robot-robot1/leases/robot-update"


def lease(kube: Kube, holder: str, clock: Clock, wall: float = 1_700_000_000.0) -> Lease:
    return Lease(kube, "robot-robot1", holder, now=clock.now, wall=lambda: wall)


@pytest.fixture(autouse=True)
def namespace(server: Server) -> None:
    server.put("/api/v1/namespaces/robot-robot1", {"metadata": {}})


def test_one_has_it_and_the_other_learns_who(server: Server, kube: Kube) -> None:
    ours, theirs = lease(kube, "a", Clock()), lease(kube, "b", Clock())
    assert ours.acquire().mine
    refused = theirs.acquire()
    assert (refused.mine, refused.holder, refused.since) == (False, "a", "2023-11-14T22:13:20.000000Z")
    assert server.find(PATH)["spec"]["leaseTransitions"] == 0
    assert ours.acquire().mine


def test_let_go_it_is_free_at_once(server: Server, kube: Kube) -> None:
    ours, theirs = lease(kube, "a", Clock()), lease(kube, "b", Clock())
    ours.acquire()
    assert not theirs.release().mine  # it was not theirs to let go
    assert server.find(PATH)["spec"]["holderIdentity"] == "a"
    ours.release()
    assert theirs.acquire().mine
    assert not ours.renew().mine
    theirs.release()
    assert not ours.renew().mine  # nobody's, and lost all the same
    assert server.find(PATH)["spec"]["leaseTransitions"] == 1


def test_a_holder_that_died_is_waited_for_from_its_last_renewal_on_by_our_own_clock(kube: Kube) -> None:
    clock = Clock()
    lease(kube, "a", Clock(), wall=0.0).acquire()  # its clock is half a century off
    theirs = lease(kube, "b", clock)
    assert not theirs.acquire().mine
    clock.time += 10
    assert lease(kube, "a", Clock(), wall=10.0).renew().since == "1970-01-01T00:00:00.000000Z"
    for seconds, over in ((10, False), (14, False), (1, True)):
        clock.time += seconds
        assert theirs.acquire().mine is over
    assert theirs.acquire().since == "2023-11-14T22:13:20.000000Z"  # not since when the dead one had it


def test_of_two_at_once_one_has_it(kube: Kube, monkeypatch: pytest.MonkeyPatch) -> None:
    """Somebody else is faster between the look and the write."""
    other, ours = lease(kube, "b", Clock()), lease(kube, "a", Clock())
    write = ours._write
    monkeypatch.setattr(ours, "_write", lambda *given: other.acquire() and write(*given))
    assert ours.acquire().holder == "b"  # created at once
    other.release()
    assert ours.acquire().holder == "b"  # taken at once


def test_an_answer_that_got_lost_does_not_lose_the_lease(kube: Kube, monkeypatch: pytest.MonkeyPatch) -> None:
    """The write is done; the answer is lost, and the second try is told that it is there already."""
    create = kube.create
    monkeypatch.setattr(kube, "create", lambda obj: create(obj) and create(obj))
    assert lease(kube, "a", Clock()).acquire().mine


def test_what_is_no_conflict_is_raised(server: Server, kube: Kube) -> None:
    server.refusals += [(403, "no leases for you")]
    with pytest.raises(ApiError, match="no leases"):
        lease(kube, "a", Clock()).acquire()
