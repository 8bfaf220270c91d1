# SPDX-License-Identifier: GPL-3.0-or-later
"""Two labs on one machine must not meet: names, subnets, addresses."""

from __future__ import annotations

from ipaddress import IPv4Network

import pytest
from lablib import lab
from lablib.errors import LabError
from lablib.names import (
    POOL,
    RESERVED,
    assign_addresses,
    check_lab_name,
    checkout_id,
    choose_subnet,
    container_name,
    network_name,
    parse_hosts,
    parse_networks,
)

SUBNET = IPv4Network("10.70.1.0/24")


def test_names_tell_checkouts_and_labs_apart() -> None:
    one, two = checkout_id("/a/main"), checkout_id("/b/main")
    names = {container_name(checkout, lab, "robot1") for checkout in (one, two) for lab in ("demo", "molecule")}
    assert len(names) == 4
    assert container_name(one, "demo", "robot1").startswith(f"{network_name(one, 'demo')}-")


def test_the_same_lab_gets_the_same_subnet_again() -> None:
    assert choose_subnet("rosops-1-demo", []) == choose_subnet("rosops-1-demo", [])
    assert choose_subnet("rosops-1-demo", []) != choose_subnet("rosops-2-demo", [])


@pytest.mark.parametrize("prefix", [24, 20])  # a wider network hides all that is in it
def test_a_taken_subnet_is_passed_over(prefix: int) -> None:
    taken = choose_subnet("seed", []).supernet(new_prefix=prefix)
    found = choose_subnet("seed", [taken])
    assert not found.overlaps(taken)
    assert (found.prefixlen, found.subnet_of(POOL)) == (24, True)


def test_the_search_goes_round_to_the_start_of_the_pool() -> None:
    free = IPv4Network("10.64.0.0/24")
    assert choose_subnet("any", POOL.address_exclude(free)) == free


def test_a_full_pool_is_an_error_that_says_what_to_do() -> None:
    with pytest.raises(LabError, match=r"no free /24 network(.|\n)*prune"):
        choose_subnet("seed", [POOL])


def test_the_pool_keeps_clear_of_pods_and_services() -> None:
    assert not any(POOL.overlaps(network) for network in RESERVED)


def test_routes_that_are_no_ipv4_networks_are_left_out() -> None:
    assert parse_networks(["default", "10.1.2.3", "10.1.0.0/16", "fd00::/8", "0.0.0.0/0", ""]) == [
        IPv4Network("10.1.2.3/32"),
        IPv4Network("10.1.0.0/16"),
    ]


def addresses(names: list[str], **kept: str) -> dict[str, str]:
    return {name: str(address) for name, address in assign_addresses(SUBNET, names, kept).items()}


def test_addresses_are_given_in_order_and_kept() -> None:
    first = {"edge1": "10.70.1.11", "robot1": "10.70.1.12"}
    assert addresses(["edge1", "robot1"]) == first
    assert addresses(["robot0", "robot1", "edge1"], **first) == {**first, "robot0": "10.70.1.13"}
    assert addresses(["edge1"], edge1="10.99.0.7") == {"edge1": "10.70.1.11"}  # of a former subnet


def test_hosts_are_parsed() -> None:
    assert parse_hosts("edge1:edge, robot-1:robots,") == {"edge1": "edge", "robot-1": "robots"}


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "no host given"),
        ("edge1", "group must be one of edge, robots"),
        ("edge1:cloud", "group must be one of edge, robots"),
        ("Robot_1:robots", "lower-case letters"),
        (":edge", "lower-case letters"),
        ("a:edge,a:robots", "used twice"),
        ("a:edge,a:edge,b:cloud", r"used twice(.|\n)*group must be(.|\n)*for example"),
    ],
)
def test_bad_hosts_are_refused(text: str, complaint: str) -> None:
    with pytest.raises(LabError, match=complaint):
        parse_hosts(text)


@pytest.mark.parametrize("name", ["", "Demo", "-x", "a/b", "../x", "a" * 60])
def test_bad_lab_names_are_refused(name: str) -> None:
    with pytest.raises(LabError, match="not usable"):
        check_lab_name(name)


def test_what_leaves_no_lab_is_asked_before_rules_that_podman_has_put_first(monkeypatch: pytest.MonkeyPatch) -> None:
    refuses = ["-s", str(POOL), "-d", lab.SERVICES, "-j", "REJECT"]
    chains = {"POSTROUTING": [["-j", "MASQUERADE"]], "FORWARD": [["-j", "ACCEPT"], refuses]}

    def iptables(command: list[str], **_how: object) -> None:
        _program, _wait, _table, _name, what, chain, *rule = command
        if what == "-I":
            chains[chain].insert(0, rule)
        elif rule in chains[chain]:
            chains[chain].remove(rule)

    monkeypatch.setattr(lab, "run", iptables)
    for _time in range(2):
        lab._put_rules_first()
    assert chains["FORWARD"] == [refuses, ["-j", "ACCEPT"]]
    assert [rule[-1] for rule in chains["POSTROUTING"]] == ["ACCEPT", "MASQUERADE"]
