# SPDX-License-Identifier: GPL-3.0-or-later
"""A whole lab with its bridge network: up, down."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from ipaddress import IPv4Network
from pathlib import Path
from typing import Any

from . import state as states
from .artifacts import Cache
from .errors import LabError
from .hosts import HostRunner
from .images import host_image
from .keys import Keys
from .names import (
    DEFAULT_HOSTS,
    POOL,
    assign_addresses,
    check_lab_name,
    checkout_id,
    choose_subnet,
    network_name,
    parse_hosts,
    parse_networks,
)
from .paths import CHECKOUT, STATE, state_dir
from .podman import podman, podman_try
from .run import run, say
from .state import Host, LabState

PARALLEL = 8
INOTIFY = Path("/proc/sys/fs/inotify/max_user_instances")
INOTIFY_NEEDED = 1024
PODS, SERVICES = "10.42.0.0/16", "10.43.0.0/16"  # of k3s, unless it is told others
# This machine's iptables see what the hosts send (bridge-nf-call-iptables). podman puts the bridge's address into all
# that leaves its network; what a host sends to another one's pods keeps its own address, as on a network of real hosts.
# A call of a Service for which its node has no rules yet would leave the lab, and somebody might answer there.
RULES = (
    ("nat", "POSTROUTING", "-s", str(POOL), "-d", PODS, "-j", "ACCEPT"),
    ("filter", "FORWARD", "-s", str(POOL), "-d", SERVICES, "-j", "REJECT"),
)


@dataclass(frozen=True)
class Lab:
    """One lab of this checkout, by name."""

    name: str
    cache: Cache
    checkout: str = checkout_id(str(CHECKOUT))

    def __post_init__(self) -> None:
        check_lab_name(self.name)

    @property
    def directory(self) -> Path:
        return state_dir(self.name)

    @property
    def network(self) -> str:
        return network_name(self.checkout, self.name)

    @property
    def keys(self) -> Keys:
        return Keys(self.directory / "ssh")

    @property
    def labels(self) -> dict[str, str]:
        return {"rosops.checkout": self.checkout, "rosops.lab": self.network}

    def runner(self, state: LabState, name: str) -> HostRunner:
        return HostRunner(self.checkout, state, state.host(name), self.keys, self.directory)

    def runners(self, state: LabState) -> list[HostRunner]:
        return [self.runner(state, host.name) for host in state.hosts]

    # --- up --------------------------------------------------------------------------------------------------------

    def up(self, hosts: str | None, *, fresh: bool) -> LabState:
        """Mends what is there and makes what is missing; with `fresh` every host is a new one."""
        groups = parse_hosts(hosts) if hosts else self._known_groups()
        _raise_inotify_limit()
        image = host_image(self.cache)
        with self.cache.lock(f"lab-{self.network}", f"another command on lab {self.name}"):
            if fresh:
                self._remove_containers(keep=set())
            state = self._state(groups)
            self._remove_containers(keep={runner.container for runner in self.runners(state)})
            self.keys.write_known_hosts({host.name: host.address for host in state.hosts})
            states.save(state)
            _each(self.runners(state), lambda runner: runner.ensure(image, self.network, self.labels))
            _put_rules_first()
            return state

    def _known_groups(self) -> dict[str, str]:
        known = states.load(self.name)
        return {host.name: host.group for host in known.hosts} if known else parse_hosts(DEFAULT_HOSTS)

    def _state(self, groups: Mapping[str, str]) -> LabState:
        subnet = ensure_network(self.cache, self.network, self.labels)
        known = states.load(self.name)
        fixed = {host.name: host.address for host in known.hosts} if known else {}
        addresses = assign_addresses(subnet, groups, fixed)
        hosts = tuple(Host(name, group, str(addresses[name])) for name, group in groups.items())
        return LabState(self.name, str(subnet), hosts)

    # --- down ------------------------------------------------------------------------------------------------------

    def down(self) -> None:
        """Removes the hosts, their volumes, the network and the state, also of a lab whose state was lost."""
        with self.cache.lock(f"lab-{self.network}", f"another command on lab {self.name}"):
            self._remove_containers(keep=set())
            for volume in podman("volume", "ls", "--quiet", f"--filter=label=rosops.lab={self.network}").split():
                podman("volume", "rm", "--force", volume)
            if podman_try("network", "inspect", self.network).returncode == 0:
                podman("network", "rm", "--force", self.network)
            shutil.rmtree(self.directory, ignore_errors=True)

    def _remove_containers(self, keep: set[str]) -> None:
        text = f"--filter=label=rosops.lab={self.network}"
        found = podman("ps", "--all", text, "--format", "{{.Names}}").split()
        prefix = f"{self.network}-"
        state = LabState(self.name, "", ())
        extra = [name.removeprefix(prefix) for name in found if name not in keep]
        runners = [HostRunner(self.checkout, state, Host(name, "", ""), self.keys, self.directory) for name in extra]
        _each(runners, HostRunner.remove)


def _taken() -> list[IPv4Network]:
    """What podman's networks and this machine's routes and addresses cover."""
    names = podman("network", "ls", "--format", "{{.Name}}").split()
    networks = json.loads(podman("network", "inspect", *names)) if names else []
    routes = json.loads(run(["ip", "-json", "-4", "route", "show", "table", "all"]).stdout or "[]")
    return parse_networks([*_subnets(networks), *(str(route.get("dst", "")) for route in routes)])


def _subnets(networks: list[dict[str, Any]]) -> list[str]:
    return [entry["subnet"] for network in networks for entry in network.get("subnets") or []]


def ensure_network(cache: Cache, name: str, labels: dict[str, str]) -> IPv4Network:
    """The network's subnet; it is made where it is missing. One at a time per machine: subnets must not clash."""
    with cache.lock("network", "another lab to make its network"):
        found = podman_try("network", "inspect", name)
        if found.returncode == 0:
            subnets = parse_networks(_subnets(json.loads(found.stdout)))
            if len(subnets) == 1:
                return subnets[0]
            raise LabError(f"the podman network {name} is not the lab's", todo=f"podman network rm -f {name}")
        subnet = choose_subnet(name, _taken())
        flags = [f"--label={key}={value}" for key, value in labels.items()]
        podman("network", "create", "--disable-dns", f"--subnet={subnet}", *flags, name)
        say(f"network {name}: {subnet}")
        return subnet


def _put_rules_first() -> None:
    """Before those that podman puts first when it makes its first network; they stay until the next reboot."""
    for table, *rule in RULES:
        run(["iptables", "-w", "-t", table, "-D", *rule], check=False)
        run(["iptables", "-w", "-t", table, "-I", *rule])


def _raise_inotify_limit() -> None:
    """The one kernel setting that the lab changes, until the next reboot: the hosts share the machine's limit, and
    systemd, containerd and a kubelet in each of them use up the default of 128."""
    present = int(INOTIFY.read_text())
    if present >= INOTIFY_NEEDED:
        return
    try:
        INOTIFY.write_text(str(INOTIFY_NEEDED))
    except OSError as error:
        raise LabError(
            f"the limit of inotify instances is {present}, which is too low for several hosts",
            where=f"{INOTIFY}: {error}",
            todo=f"sysctl fs.inotify.max_user_instances={INOTIFY_NEEDED}",
        ) from error
    say(f"raised fs.inotify.max_user_instances from {present} to {INOTIFY_NEEDED} until the next reboot")


def labs_of_checkout(cache: Cache) -> list[Lab]:
    """All that have state, a container or a network."""
    checkout = checkout_id(str(CHECKOUT))
    prefix = f"rosops-{checkout}-"
    label = f"--filter=label=rosops.checkout={checkout}"
    containers = podman("ps", "--all", label, "--format", '{{index .Labels "rosops.lab"}}').split()
    networks = podman("network", "ls", label, "--format", "{{.Name}}").split()
    names = {name.removeprefix(prefix) for name in [*containers, *networks]}
    stateful = {path.name for path in STATE.glob("*") if path.is_dir()}
    return [Lab(name, cache) for name in sorted(names | stateful)]


def _each(runners: Iterable[HostRunner], action: Callable[[HostRunner], None]) -> None:
    """In parallel; all failures are reported, not only the first."""
    everyone = list(runners)
    if not everyone:
        return
    errors: list[str] = []
    with ThreadPoolExecutor(PARALLEL) as pool:
        futures = [pool.submit(action, runner) for runner in everyone]
        for future in futures:
            try:
                future.result()
            except LabError as error:
                errors.append(str(error))
    if errors:
        raise LabError("\n".join(errors))
