# SPDX-License-Identifier: GPL-3.0-or-later
"""The firewall that docs/ports.md shows, on the hosts of a fleet at work."""

from __future__ import annotations

import contextlib
import json
import re
import socket
import subprocess
from collections.abc import Iterator

import pytest
from doc_blocks import CHECKOUT, blocks_of
from fleet import LIMIT, Fleet
from runs import wait_until

EDGE, TABLE = "edge1", "inet rosops_fleet"
OVERLAY = 8472
OF_SERVERS, OF_HOSTS, ANYWHERE = 6443, 10250, 9100
LISTEN = f"systemd-run --unit by-the-test python3 -m http.server {ANYWHERE}"
SECONDS = 2.0  # for an answer; what is dropped has none


def shown(fleet: Fleet, control: str) -> str:
    """The page's file, with this fleet's addresses in its sets."""
    page = blocks_of("ports.md", (CHECKOUT / "docs/ports.md").read_text("utf-8"))
    [text] = [one.text for one in page if one.text.startswith("#!/usr/sbin/nft")]
    hosts = [fleet.hosts.address(host) for host in (EDGE, *fleet.robots)]
    for name, addresses in {"control": [control], "servers": hosts[:1], "hosts": hosts}.items():
        elements = rf"(set {name} \{{[^}}]*elements = )\{{[^}}]*\}}"
        text, found = re.subn(elements, rf"\g<1>{{ {', '.join(addresses)} }}", text)
        assert found == 1, f"docs/ports.md has {found} sets {name}"
    return text


@contextlib.contextmanager
def firewall(fleet: Fleet, text: str) -> Iterator[None]:
    """On every host; loaded twice, as whoever changes the file does."""
    hosts = [EDGE, *fleet.robots]
    try:
        for host in hosts * 2:
            fleet.hosts.ssh(host, "nft -f -", text)
        yield
    finally:
        for host in hosts:
            fleet.hosts.ssh(host, f"nft 'add table {TABLE}; delete table {TABLE}'")  # also where it was not loaded


@contextlib.contextmanager
def laptop(fleet: Fleet) -> Iterator[tuple[str, str]]:
    """An address in the hosts' network that is none of the fleet's, and that of the control node."""
    words = ["ip", "-j", "route", "get", fleet.hosts.address(EDGE)]
    route = subprocess.run(words, capture_output=True, check=True)  # noqa: S603 - by PATH
    [way] = json.loads(route.stdout)
    own, device = way["prefsrc"], way["dev"]
    address = f"{own.rpartition('.')[0]}.250"
    subprocess.run(["ip", "address", "add", f"{address}/24", "dev", device], check=True)  # noqa: S603, S607 - by PATH
    try:
        yield address, own
    finally:
        subprocess.run(["ip", "address", "delete", f"{address}/24", "dev", device], check=True)  # noqa: S603, S607 - by PATH


def reached(fleet: Fleet, source: str) -> list[tuple[str, int]]:
    """The hosts' ports that take a connection from an address of this machine."""
    tried = [(host, port) for host in (EDGE, *fleet.robots) for port in (22, OF_SERVERS, ANYWHERE, OF_HOSTS)]
    found = []
    for host, port in tried:
        with contextlib.suppress(OSError):
            socket.create_connection((fleet.hosts.address(host), port), SECONDS, (source, 0)).close()
            found.append((host, port))
    return found


def dropped(fleet: Fleet, host: str) -> int:
    """Packets of the overlay that the host has refused."""
    rules = fleet.hosts.ssh(host, f"nft list table {TABLE}")
    return int(re.findall(rf"udp dport {OVERLAY} counter packets (\d+)", rules)[0])


@pytest.fixture
def listening(fleet: Fleet) -> Iterator[None]:
    """Where the node exporter would, which this fleet has not."""
    for robot in fleet.robots:
        fleet.hosts.ssh(robot, LISTEN)
    yield
    for robot in fleet.robots:
        fleet.hosts.ssh(robot, "systemctl stop by-the-test")


@pytest.mark.promise(
    "the firewall of the docs: an update under traffic loses nothing, a laptop reaches none of the hosts' ports"
)
@pytest.mark.usefixtures("listening")
def test_the_firewall_of_the_docs(fleet: Fleet) -> None:
    of_robots = [(robot, port) for robot in fleet.robots for port in (22, ANYWHERE, OF_HOSTS)]
    open_to_all = [(EDGE, 22), (EDGE, OF_SERVERS), (EDGE, OF_HOSTS), *of_robots]
    robot = fleet.robots[0]
    with laptop(fleet) as (stranger, control):
        wait_until(lambda: reached(fleet, stranger), lambda found: found == open_to_all, 20, "all ports open")
        watch = fleet.watch()
        with firewall(fleet, shown(fleet, control)):
            wanted = fleet.new_version(robot, "add-two-ints", on=fleet.new_version(robot, "temperature"))
            fleet.update(wanted, *LIMIT).must(0, robot1="updated")
            watch.assert_nothing_lost(robot)
            assert reached(fleet, stranger) == []
            assert reached(fleet, control) == [(EDGE, 22), (EDGE, OF_SERVERS), *((one, 22) for one in fleet.robots)]
            by = f"timeout 5 bash -c 'exec 3<>/dev/tcp/{fleet.hosts.address(robot)}/{ANYWHERE}' && echo open"
            assert fleet.hosts.ssh(EDGE, by).strip() == "open"
            before = dropped(fleet, robot)
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
                sender.bind((stranger, 0))
                sender.sendto(b"x", (fleet.hosts.address(robot), OVERLAY))
            assert dropped(fleet, robot) == before + 1
        assert reached(fleet, stranger) == open_to_all
