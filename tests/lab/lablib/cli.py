# SPDX-License-Identifier: GPL-3.0-or-later
"""The command line of the lab."""

from __future__ import annotations

import argparse
import json
import os
import signal
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from types import FrameType

from . import k3s, observability, observability_build, state
from .app_images import app_archives
from .artifacts import Cache
from .environments import environment
from .errors import LabError
from .go import go_command, go_environment
from .hosts import HostRunner
from .images import host_image
from .inventory import host_variables, hosts_file, inventory
from .lab import Lab, labs_of_checkout
from .names import DEFAULT_HOSTS
from .paths import COMMAND, LABK3S, cache_dir
from .podman import cgroups, podman_try
from .run import interrupt_all, say
from .setup import setup

ACTIONS = {
    "up": HostRunner.start,
    "down": HostRunner.stop,
    "cut": HostRunner.cut,
    "join": HostRunner.join,
}


def main(arguments: list[str] | None = None) -> int:
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _interrupted)
    options = _parser().parse_args(arguments)
    try:
        return int(options.run(options) or 0)
    except LabError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("interrupted; what was whole is kept, the next run goes on from there", file=sys.stderr)
        return 130


def _interrupted(_number: int, _frame: FrameType | None) -> None:
    interrupt_all()
    raise KeyboardInterrupt


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog=COMMAND, description="Hosts, images and artifacts of the test lab.")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    lab = argparse.ArgumentParser(add_help=False)
    name = os.environ.get("ROSOPS_LAB") or "demo"
    lab.add_argument("--lab", default=name, help="which lab (default: $ROSOPS_LAB, else demo)")

    prepare = commands.add_parser("setup", help="install missing Debian packages, make .venv and the collections link")
    prepare.add_argument("--tests", action="store_true", help="also the packages that only tests need")
    prepare.set_defaults(run=lambda options: setup(_cache(), options.tests))

    up = commands.add_parser("up", parents=[lab], help="start the hosts; mends or replaces what is broken")
    up.add_argument("--hosts", help=f"name:group,... (default: the lab's present hosts, else {DEFAULT_HOSTS})")
    up.add_argument("--fresh", action="store_true", help="replace every host by a bare one")
    up.set_defaults(run=_up)

    down = commands.add_parser("down", parents=[lab], help="remove the hosts, their volumes, network and state")
    down.add_argument("--all", action="store_true", help="every lab of this checkout")
    down.set_defaults(run=_down)

    host = commands.add_parser("host", parents=[lab], help="do something to one host")
    host.add_argument("name")
    host.add_argument("action", choices=[*ACTIONS, "reboot"], help="cut and join: off the network and on again")
    host.set_defaults(run=_host)

    status = commands.add_parser("status", parents=[lab], help="what runs")
    status.set_defaults(run=_status)

    ssh = commands.add_parser("ssh", parents=[lab], help="a shell, or one command, on a host")
    ssh.add_argument("name")
    ssh.add_argument("command", nargs=argparse.REMAINDER)
    ssh.set_defaults(run=_ssh)

    listing = commands.add_parser("inventory", parents=[lab], help="the lab as an Ansible inventory")
    listing.add_argument("--list", action="store_true")
    listing.add_argument("--host")
    listing.add_argument("--yaml", action="store_true", help="as a file hosts.yml for an inventory of one's own")
    listing.set_defaults(run=_inventory)

    artifacts = commands.add_parser("artifacts", help="build what is missing: images, k3s, archives")
    artifacts.add_argument("--no-ros", action="store_true", help="hosts and k3s only: ROS and apps come from elsewhere")
    artifacts.add_argument("--next-k3s", action="store_true", help="also the versions to upgrade to")
    artifacts.add_argument(
        "--observability",
        nargs="*",
        metavar="PART",
        help=f"also the images that watch a fleet, all or some of {', '.join(observability.parts())}",
    )
    artifacts.set_defaults(run=_artifacts)

    program = commands.add_parser("program", help="print the path of promtool or another observability program")
    program.add_argument("name")
    program.add_argument("--no-build", action="store_true", help="fail where it is not built yet")
    program.set_defaults(run=_program)

    python = commands.add_parser("python", help="print the path of an environment's Python; makes what is missing")
    python.add_argument("name", help="as in tests/environments")
    python.set_defaults(run=lambda options: print(environment(_cache(), options.name).python))

    go = commands.add_parser("go", help="run the pinned Go toolchain in tests/lab/labk3s, with the lab's caches")
    go.add_argument("arguments", nargs=argparse.REMAINDER)
    go.set_defaults(run=_go)

    commands.add_parser("wipe-cache", help="remove all built artifacts").set_defaults(run=_wipe)
    return parser


def _cache() -> Cache:
    return Cache(cache_dir())


def _up(options: argparse.Namespace) -> None:
    started = time.monotonic()
    found = Lab(options.lab, _cache()).up(options.hosts, fresh=options.fresh)
    hosts = ", ".join(f"{host.name} {host.address}" for host in found.hosts)
    say(f"lab {found.name} is up in {time.monotonic() - started:.1f} s: {hosts}")


def _down(options: argparse.Namespace) -> None:
    labs = labs_of_checkout(_cache()) if options.all else [Lab(options.lab, _cache())]
    for lab in labs:
        lab.down()
        say(f"lab {lab.name} is gone")


def _runner(options: argparse.Namespace) -> HostRunner:
    return Lab(options.lab, _cache()).runner(state.require(options.lab), options.name)


def _host(options: argparse.Namespace) -> None:
    runner = _runner(options)
    if not runner.status():
        raise LabError(f"host {options.name} has no container", todo=f"run {COMMAND} up --lab {options.lab}")
    if options.action == "reboot":
        runner.stop()
        runner.start()
    else:
        ACTIONS[options.action](runner)
    say(f"{options.name}: {options.action} done")


def _status(options: argparse.Namespace) -> None:
    found = state.require(options.lab)
    print(f"lab {found.name}: subnet {found.subnet}, cgroups {cgroups()}, {_k3s_line()}")
    for runner in Lab(options.lab, _cache()).runners(found):
        where = runner.host
        print(f"{where.name:<12} {where.group:<8} {where.address:<16} {_condition(runner)}")


def _condition(runner: HostRunner) -> str:
    status = runner.status()
    if status != "running":
        return status or "missing"
    if runner.is_cut():
        return "running, cut off"
    return f"running, systemd {podman_try('exec', runner.container, 'systemctl', 'is-system-running').stdout.strip()}"


def _k3s_line() -> str:
    known = state.load_artifacts()
    return f"k3s: {k3s.describe(known['k3s'])}" if "k3s" in known else "k3s: not built yet"


def _ssh(options: argparse.Namespace) -> None:
    command = _runner(options).ssh_command()
    words = options.command[1:] if options.command[:1] == ["--"] else options.command
    os.execvp(command[0], [*command, *words])  # noqa: S606 - the user asked for a shell there


def _inventory(options: argparse.Namespace) -> None:
    lab = Lab(options.lab, _cache())
    found = state.require(options.lab)
    listing = inventory(found, lab.keys, str(lab.directory), state.load_artifacts())
    if options.yaml:
        print(hosts_file(listing), end="")
    else:
        value = host_variables(found.host(options.host), lab.keys) if options.host else listing
        print(json.dumps(value, indent=2))


def _artifacts(options: argparse.Namespace) -> None:
    started = time.monotonic()
    cache = _cache()
    choice = k3s.choose()
    # The Go build and the Debian trees use the machine in turns: one computes while the other downloads.
    with ThreadPoolExecutor(2) as pool:
        k3s_dir = pool.submit(k3s.airgap, cache, choice)
        archives = pool.submit(lambda: (host_image(cache), {} if options.no_ros else app_archives(cache))[1])
        built = list(archives.result().values())
        directory = k3s_dir.result()
    values = {
        "k3s": choice,
        "airgap_dir": str(directory),
        "image_archives": [str(path) for path in built[:1]],
        "update_archives": [str(path) for path in built[1:]],
    }
    for following in ("next", "minor") if options.next_k3s else ():
        values[f"{following}_airgap_dir"] = str(k3s.airgap(cache, choice, f"{following}_version"))
    if options.observability is not None:
        for part in observability.choose(options.observability):  # one after the other: each build uses every core
            observability_build.ensure(cache, part)
    state.save_artifacts(values | observability.built(cache))
    say(f"artifacts are ready in {time.monotonic() - started:.1f} s")


def _program(options: argparse.Namespace) -> None:
    cache = _cache()
    part = observability.part_with(options.name)
    artifact = cache.path(observability.recipe(part))
    if options.no_build and not artifact.is_dir():
        raise LabError(f"{options.name} is not built", todo=f"run {COMMAND} artifacts --observability {part.name}")
    print(observability.program_path(observability_build.ensure(cache, part), part, options.name))


def _go(options: argparse.Namespace) -> None:
    environment = go_environment()
    environment["GOFLAGS"] += f" -modfile={k3s.labk3s_modules(_cache())}"
    os.chdir(LABK3S)
    go = go_command()
    os.execve(go, [go, *options.arguments], {**os.environ, **environment})  # noqa: S606 - no shell


def _wipe(_options: argparse.Namespace) -> None:
    _cache().wipe()
    say(f"removed the artifacts under {cache_dir()}")
