# SPDX-License-Identifier: GPL-3.0-or-later
"""Hosts: systemd containers with an address, a key and a volume of their own."""

from __future__ import annotations

import hashlib
import ipaddress
import json
import shlex
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from .errors import LabError
from .keys import Keys
from .names import container_name, volume_name
from .paths import COMMAND
from .podman import limits, podman, podman_try
from .run import run, say
from .state import Host, LabState, write_whole

BOOT_SECONDS = 90
STOP_SECONDS = 30
# No --systemd=always: with it podman mounts the machine's own systemd cgroup hierarchy into every host on cgroup v1,
# and stopping a service in one host kills it in all. A private cgroup namespace serves v1 and v2 alike.
FLAGS = (
    *("--systemd=false", "--privileged", "--cgroupns=private", "--env=container=podman"),
    *("--stop-signal=SIGRTMIN+3", "--pids-limit=-1", "--log-driver=k8s-file", "--log-opt=max-size=10mb"),
    *("--tmpfs=/run", "--tmpfs=/run/lock", "--tmpfs=/tmp", "--init=false", "--restart=no"),
)


def mac_address(address: str) -> str:
    """The same one after every restart: neighbours would go on sending to a former one for up to half a minute."""
    return "02:72:" + ipaddress.IPv4Address(address).packed.hex(":")


def wait_for(what: str, look: Callable[[], tuple[bool, str]], *, seconds: float, todo: str = "") -> str:
    """Looks until `look` says (True, observation); a time-out is an error that carries the last observation."""
    deadline = time.monotonic() + seconds
    while True:
        done, observed = look()
        if done:
            return observed
        if time.monotonic() >= deadline:
            raise LabError(f"{what}: not within {seconds:g} s", where=f"last seen: {observed}", todo=todo)
        time.sleep(0.25)


@dataclass(frozen=True)
class HostRunner:
    """Everything that is done to one host of one lab."""

    checkout: str
    state: LabState
    host: Host
    keys: Keys
    directory: Path

    @property
    def container(self) -> str:
        return container_name(self.checkout, self.state.name, self.host.name)

    @property
    def volume(self) -> str:
        return volume_name(self.checkout, self.state.name, self.host.name)

    @property
    def _routes(self) -> Path:
        return self.directory / f"cut-{self.host.name}.routes"

    # --- life ------------------------------------------------------------------------------------------------------

    def spec(self, image: str) -> str:
        """A digest of all that a host is made of: one that differs is replaced."""
        network = [self.state.subnet, self.host.address, mac_address(self.host.address)]
        keys = [self.keys.user_public(), self.keys.host_public(self.host.name)]
        return hashlib.sha256(json.dumps([image, *network, *keys, *FLAGS, *limits()]).encode()).hexdigest()[:16]

    def status(self) -> str:
        """podman's word for the container's state; empty where there is none."""
        found = podman_try("container", "inspect", "--format", "{{.State.Status}}", self.container)
        return found.stdout.strip() if found.returncode == 0 else ""

    def ensure(self, image: str, network: str, labels: dict[str, str]) -> None:
        """Up, reachable, and made of what it should be made of; a host that cannot be mended is replaced once."""
        if self._is_whole(image):
            try:
                self.start()
                return
            except LabError as error:
                say(f"{self.host.name}: is replaced, it does not come up:\n{error}")
        self.remove()
        self._create(image, network, labels)
        podman("start", self.container)
        self._wait_booted()
        self.wait_ssh()

    def _is_whole(self, image: str) -> bool:
        text = '{{.State.Status}} {{index .Config.Labels "rosops.spec"}}'
        found = podman_try("container", "inspect", "--format", text, self.container)
        if found.returncode != 0:
            return False
        status, _space, spec = found.stdout.strip().partition(" ")
        # A container that never ran may lack its keys: they are copied between its creation and its first start.
        return spec == self.spec(image) and status in ("running", "exited", "stopped")

    def _create(self, image: str, network: str, labels: dict[str, str]) -> None:
        every = {**labels, "rosops.spec": self.spec(image)}
        flags = [f"--label={key}={value}" for key, value in every.items()]
        podman("volume", "create", *(f"--label={key}={value}" for key, value in labels.items()), self.volume)
        podman(
            *("create", f"--name={self.container}", f"--hostname={self.host.name}", *FLAGS, *limits(), *flags),
            *(f"--network={network}", f"--ip={self.host.address}", f"--mac-address={mac_address(self.host.address)}"),
            *(f"--volume={self.volume}:/var/lib/rancher", image, "/sbin/init"),
        )
        podman("cp", "-", f"{self.container}:/", stdin=self.keys.host_files(self.host.name))

    def remove(self) -> None:
        """Also what is left of a half-made one. The first attempt may fail while pods are still being killed."""

        def gone() -> tuple[bool, str]:
            done = podman_try("rm", "--force", "--ignore", "--time=0", self.container)
            return self.status() == "", done.stderr.strip() or "still there"

        wait_for(f"removing host {self.host.name}", gone, seconds=60)
        self._routes.unlink(missing_ok=True)
        podman_try("volume", "rm", "--force", self.volume)
        if podman_try("volume", "exists", self.volume).returncode == 0:
            raise LabError(f"volume {self.volume} cannot be removed", todo=f"podman volume rm --force {self.volume}")

    # --- what a scenario does to a host ----------------------------------------------------------------------------

    def start(self) -> None:
        """Running, on the network, and answering. Services that failed are said: they may be a scenario's own."""
        if self.status() != "running":
            self._routes.unlink(missing_ok=True)
            podman("start", self.container)
        elif self.is_cut():
            self.join()
        self.wait_ssh()
        failed = self._failed_units()
        if failed:
            say(f"{self.host.name}: failed units: {failed}")

    def stop(self) -> None:
        """Shut down as by its power button; after a while the power is cut."""

        def stopped() -> tuple[bool, str]:
            done = podman_try("stop", f"--time={STOP_SECONDS}", self.container, timeout=STOP_SECONDS + 60)
            status = self.status()
            return status in ("exited", "stopped"), f"{status}: {done.stderr.strip()}"

        if self.status() == "running":
            wait_for(f"stopping host {self.host.name}", stopped, seconds=120)
        self._routes.unlink(missing_ok=True)

    def cut(self) -> None:
        """Takes the host off the network. Its routes go with the link, so they are kept for `join`."""
        if self._routes.exists():
            return
        write_whole(self._routes, self._in_network("ip", "-4", "route", "show", "dev", "eth0"))
        self._in_network("ip", "link", "set", "eth0", "down")

    def join(self) -> None:
        self._in_network("ip", "link", "set", "eth0", "up")
        if not self._routes.exists():
            return
        routes = self._routes.read_text().splitlines()
        # the host's own subnet comes back with the link; what goes through it can be restored only then
        for route in sorted(routes, key=lambda line: " via " in f" {line}"):
            if "proto kernel" not in route:
                self._in_network("ip", "route", "replace", *shlex.split(route), "dev", "eth0")
        self._routes.unlink()

    def is_cut(self) -> bool:
        return self._routes.exists()

    def _in_network(self, *command: str) -> str:
        pid = podman("container", "inspect", "--format", "{{.State.Pid}}", self.container).strip()
        if pid in ("", "0"):
            raise LabError(f"host {self.host.name} is not running", todo=f"{COMMAND} host {self.host.name} up")
        return run(["nsenter", f"--net=/proc/{pid}/ns/net", *command]).stdout

    # --- waiting ---------------------------------------------------------------------------------------------------

    def _failed_units(self) -> str:
        command = ("systemctl", "list-units", "--failed", "--plain", "--no-legend")
        listing = podman_try("exec", self.container, *command).stdout
        return ", ".join(line.split()[0] for line in listing.splitlines() if line.strip())

    def _wait_booted(self) -> None:
        def booted() -> tuple[bool, str]:
            done = podman_try("exec", self.container, "systemctl", "is-system-running")
            said = done.stdout.strip() or done.stderr.strip()
            return said in ("running", "degraded"), said

        said = wait_for(
            f"booting host {self.host.name}", booted, seconds=BOOT_SECONDS, todo=f"podman logs {self.container}"
        )
        if said == "degraded":
            raise LabError(
                f"host {self.host.name} booted with failed units: {self._failed_units()}",
                todo=f"podman exec {self.container} systemctl --failed",
            )

    def wait_ssh(self) -> None:
        def answers() -> tuple[bool, str]:
            done = run([*self.ssh_command(), "true"], check=False, timeout=30)
            return done.returncode == 0, done.stderr.strip() or f"ssh ended with {done.returncode}"

        wait_for(f"SSH to host {self.host.name}", answers, seconds=BOOT_SECONDS, todo=f"podman logs {self.container}")

    def ssh_command(self) -> list[str]:
        identity = str(self.keys.private_key).replace("%", "%%")
        options = [*self.keys.options(), "-o", "BatchMode=yes", "-o", "ConnectTimeout=5", "-o", "LogLevel=ERROR"]
        return ["ssh", "-F", "none", *options, "-i", identity, f"root@{self.host.address}"]
