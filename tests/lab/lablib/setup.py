# SPDX-License-Identifier: GPL-3.0-or-later
"""What the project needs on this machine: Debian packages that are missing, `.venv`, the collections link."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

from .artifacts import Cache
from .environments import tools_environment
from .errors import LabError
from .names import checkout_id
from .paths import CHECKOUT, INSTALLED, LOGS
from .run import Job, build, run, say

# Each with what it is for. Where the command is there, or one of several, the package is left out: it may come from
# elsewhere than Debian's packages, and theirs may be at odds with it, as runc with that of Docker's containerd.
PACKAGES = {
    "ca-certificates": "",  # the registries' certificates
    "curl": "curl",  # the real k3s, where it can be downloaded
    "git": "git",  # ansible-test's copy of the checkout
    "iproute2": "ip",
    "iptables": "iptables",  # podman's network
    "mmdebstrap": "mmdebstrap",
    "netavark": "",
    "openssh-client": "ssh",
    "podman": "podman",
    "rsync": "rsync",  # the role collect
    "python3-venv": "",
    "runc": "runc",
    "stress-ng": "stress-ng",  # make bench
}
# What only tests need; without these they skip, and say so.
TEST_PACKAGES = {
    "chromium": "chromium chromium-browser google-chrome",  # tests/browser
    "python3-actionlib": "",  # tests/ros: nodes on this machine, beside the lab's
    "python3-roslaunch": "",
    "python3-rosmaster": "",
    "python3-rospy": "",
    "python3-std-msgs": "",
    "python3-std-srvs": "",
    "rosout": "",
    "shellcheck": "",  # ansible-test sanity
    "topic-tools": "",
}
OS_RELEASE = Path("/etc/os-release")
LINK = CHECKOUT / ".ansible" / "collections" / "ansible_collections" / "rosops" / "fleet"


def setup(cache: Cache, tests: bool = False) -> None:
    """All of it; what is there already is left alone, what an interruption left half-done is done again."""
    LOGS.mkdir(exist_ok=True)
    with cache.lock(f"setup-{checkout_id(str(CHECKOUT))}", "another set-up of this checkout"):
        _packages(cache, packages(tests, OS_RELEASE.read_text() if OS_RELEASE.exists() else ""))
        if not INSTALLED:
            tools_environment().ensure()
            _link()


# --- Debian packages -----------------------------------------------------------------------------------------------


def packages(tests: bool, system: str) -> dict[str, str]:
    """What a system is to have; `system` is the text of its os-release."""
    wanted = PACKAGES | TEST_PACKAGES if tests else PACKAGES
    if "ID=ubuntu" in system.splitlines():  # its chromium is no package, and one unknown name fails all of them
        return {name: commands for name, commands in wanted.items() if name != "chromium"}
    return wanted


def _there(commands: str) -> bool:
    return any(shutil.which(command) for command in commands.split())


def _installed(names: list[str]) -> set[str]:
    listing = run(["dpkg-query", "--show", "--showformat=${Package} ${db:Status-Status}\n", *names], check=False).stdout
    return {line.split()[0] for line in listing.splitlines() if line.endswith(" installed")}


def _packages(cache: Cache, wanted: dict[str, str]) -> None:
    if not shutil.which("dpkg-query"):
        _require_commands()
        return
    lacking = [name for name, commands in wanted.items() if not _there(commands)]
    missing = sorted(set(lacking) - _installed(lacking))
    if not missing:
        return
    if os.geteuid() != 0:
        raise LabError("Debian packages are missing", todo=f"as root: apt-get install {' '.join(missing)}")
    apt = ["apt-get", "--quiet", "--yes", "-o", "DPkg::Lock::Timeout=300", "-o", "Acquire::Retries=3"]
    env = {"DEBIAN_FRONTEND": "noninteractive"}
    log = LOGS / "apt.log"
    log.unlink(missing_ok=True)
    say(f"installing Debian packages: {' '.join(missing)} (log {log})")
    with cache.lock("apt", "another set-up's package installation"):
        build(Job([*apt, "update"], "Debian's package lists", log, env=env))
        build(Job([*apt, "install", "--no-install-recommends", *missing], "Debian packages", log, env=env))


def _require_commands() -> None:
    missing = [command for command in PACKAGES.values() if command and not _there(command)]
    if missing:
        raise LabError(
            f"these programs are missing: {', '.join(missing)}",
            where="this is no Debian system, so nothing is installed for you",
            todo="install them; the lab is made for Debian 12",
        )


# --- the collection's place in a collections tree ------------------------------------------------------------------


def _link() -> None:
    """`ansible_collections/rosops/fleet` leads to the checkout, so that the collection's full names are found."""
    target = Path(os.path.relpath(CHECKOUT, LINK.parent))
    if LINK.is_symlink() and LINK.readlink() == target:
        return
    LINK.parent.mkdir(parents=True, exist_ok=True)
    if LINK.exists() and not LINK.is_symlink():
        raise LabError("the collection's place is taken", where=str(LINK), todo="remove it, then run `make setup`")
    LINK.unlink(missing_ok=True)
    LINK.symlink_to(target)
