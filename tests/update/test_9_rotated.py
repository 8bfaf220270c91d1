# SPDX-License-Identifier: GPL-3.0-or-later
"""Certificates of k3s and the servers' token are made anew under robots at work, and the robots notice nothing."""

from __future__ import annotations

import json

import pytest
import urllib3
from cluster import ask
from fleet import Fleet
from runs import Run, wait_until
from test_4_k3s import BINARY, EDGE, HOSTS, change, on, starts, unproven

DATA = "/var/lib/rancher/k3s"
NODE = f"{DATA}/agent/client-kubelet"
TOKEN = "/etc/rancher/k3s/token"  # noqa: S105 - where it is
WAVES = [1, "100%"]


def rotate(fleet: Fleet, *arguments: str, **variables: object) -> Run:
    return fleet.playbooks.run("rotate", {**fleet.variables, "update_waves": WAVES, **variables}, *arguments)


def keys(fleet: Fleet) -> dict[str, str]:
    """Of each host's kubelet, by their digests."""
    return on(fleet, f"sha256sum {NODE}.key | cut -d' ' -f1")


def copies(fleet: Fleet, host: str) -> list[str]:
    """What k3s itself has kept of earlier certificates."""
    return fleet.hosts.ssh(host, f"ls -d {DATA}/server/tls-* {DATA}/agent/tls-* 2>/dev/null || true").split()


def assert_no_k3s_starts_anew(fleet: Fleet) -> None:
    """What was made anew is nothing that the inventory says otherwise."""
    before = starts(fleet)
    again = change(fleet)
    assert (again.status, again.changed, starts(fleet)) == (0, 0, before), again


@pytest.mark.long
@pytest.mark.promise("certificates of k3s are made anew under robots at work, and they notice nothing")
def test_certificates_are_made_anew_under_robots_at_work(fleet: Fleet) -> None:
    before, pods, earlier = keys(fleet), fleet.running(), {host: copies(fleet, host) for host in HOSTS}
    # robots are let in by a token that is made for it, whatever has become of theirs
    for listed in json.loads(fleet.hosts.ssh(EDGE, f"{BINARY} token list -o json")):
        fleet.hosts.ssh(EDGE, f"{BINARY} token delete {listed['token']}")
    looked = rotate(fleet, "--check").must(0)
    assert keys(fleet) == before
    watch = fleet.watch()
    run = rotate(fleet).must(0)
    now = keys(fleet)
    for host in HOSTS:
        assert "certificates until 20" in looked.host(host)["reason"], looked
        assert "certificates until 20" in run.host(host)["reason"], run
        assert now[host] != before[host]
        assert len(copies(fleet, host)) == len(earlier[host]) + 1
        assert not unproven(fleet, host)
        assert not fleet.hosts.ssh(host, f"find {DATA}/agent {DATA}/server/tls -name '*.previous' 2>/dev/null || true")
    assert len({*now.values()}) == len(HOSTS)
    fleet.assert_still_running(pods)
    watch.assert_only_lookups_failed()
    assert_no_k3s_starts_anew(fleet)


@pytest.mark.long
def test_certificates_of_a_run_that_was_killed_are_proven_and_not_made_again(fleet: Fleet) -> None:
    before, pods = keys(fleet)[EDGE], fleet.running()
    running = fleet.playbooks.start("rotate", {**fleet.variables, "update_waves": WAVES}, "-v")
    running.wait_for(r"k3s: verify")
    running.kill()
    read = f"sha256sum {NODE}.key 2>/dev/null | cut -d' ' -f1"
    made = wait_until(lambda: fleet.hosts.ssh(EDGE, read).strip(), lambda key: key not in ("", before), 60, "a new key")
    fleet.hosts.ssh(EDGE, f"for n in $(seq 60); do {BINARY} kubectl get --raw /readyz && exit; sleep 1; done; exit 1")
    run = rotate(fleet).must(0)
    assert keys(fleet)[EDGE] == made, run
    assert "certificates until 20" in run.host(EDGE)["reason"], run
    assert not any(unproven(fleet, host) for host in HOSTS)
    fleet.assert_still_running(pods)


def lets_in(token: str) -> int:
    """What the edge says to a server that comes with this token."""
    headers = urllib3.make_headers(basic_auth=f"server:{token.rpartition(':')[2]}")
    return ask("GET", "/v1-k3s/server-bootstrap", None, headers)[0]


@pytest.mark.long
@pytest.mark.promise("the servers' token is made anew, the old one lets nobody in, and robots notice nothing")
def test_another_token_of_the_servers(fleet: Fleet) -> None:
    old, pods, before = fleet.hosts.ssh(EDGE, f"cat {TOKEN}").strip(), fleet.running(), starts(fleet)
    assert lets_in(old) == 200
    looked = rotate(fleet, "--check", rotate="token").must(0)
    assert "another token of the servers" in looked.host(EDGE)["reason"], looked
    assert fleet.hosts.ssh(EDGE, f"cat {TOKEN}").strip() == old
    watch = fleet.watch()
    run = rotate(fleet, "--diff", rotate="token").must(0)
    new = fleet.hosts.ssh(EDGE, f"cat {TOKEN}").strip()
    assert (lets_in(old), lets_in(new)) == (401, 200)
    assert fleet.hosts.ssh(EDGE, f"cat {TOKEN}.previous").strip() == old
    for secret in (old, new):
        assert secret.rpartition(":")[2] not in looked.output + run.output + json.dumps(run.report)
    now = starts(fleet)
    assert {host for host in HOSTS if now[host] != before[host]} == {EDGE}  # agents have nothing of it
    fleet.assert_still_running(pods)
    watch.assert_only_lookups_failed()
    assert_no_k3s_starts_anew(fleet)
