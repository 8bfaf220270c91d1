# SPDX-License-Identifier: GPL-3.0-or-later
"""What ours takes from a robot at rest: processor and memory per part, beside ten real nodes.

What the kubelet asks is read from the very objects that are applied, and done here as it does it.
"""

from __future__ import annotations

import contextlib
import http.client
import os
import resource
import socket
import subprocess
import time
import xmlrpc.client
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ansible_collections.rosops.fleet.plugins.module_utils._robot import keeper
from ansible_collections.rosops.fleet.plugins.module_utils._robot.memory import PERIOD, KeptFiles
from ansible_collections.rosops.fleet.plugins.module_utils._ros.registrar import Registrar
from ansible_collections.rosops.fleet.plugins.plugin_utils._model import names
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.context import Robot
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.app import app_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.master import PROBE, master_objects
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.world import ticking
from ansible_collections.rosops.fleet.tests.unit.plugins.module_utils._robot.cluster_around import (
    environment,
    start_server,
)
from exporter_scene import ExporterScene, zipped_scrape
from process_memory import cpu_seconds
from scene import PYTHON, until

APPS = 10
HERTZ = 20
BURST = 300  # questions in a row, where one is too cheap to be seen
LIMIT, LIMIT_MB = 5.0, 30.0  # of a slow core, with ten apps; to be scraped is a choice and not in the sum
INTERVAL = 10.0  # seconds between two scrapes
# The core that the limit is meant for: asking the master by a new Python every 2 s took so much of it.
EARLIER_PERIOD, EARLIER_SHARE = 2.0, 56.0


@dataclass(frozen=True)
class Row:
    """One part: thousandths of this core, and MB of memory that is its own process's (0: it has none)."""

    part: str
    cpu: float
    rss_mb: float = 0.0
    private_mb: float = 0.0
    ours: bool = True

    def as_dict(self) -> dict[str, Any]:
        found = {"part": self.part, "cpu": round(self.cpu, 3), "rss_mb": self.rss_mb, "private_mb": self.private_mb}
        return {**found, "ours": self.ours}


def memory_mb(pid: int) -> tuple[float, float]:
    """Resident, and what of it nobody else has mapped."""
    found = {"Rss": 0, "Private_Clean": 0, "Private_Dirty": 0}
    for line in Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()[1:]:
        key, _colon, value = line.partition(":")
        if key in found:
            found[key] = int(value.split()[0])
    return round(found["Rss"] / 1024, 1), round((found["Private_Clean"] + found["Private_Dirty"]) / 1024, 1)


# ---- the kubelet


def probes(container: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Those that go on for as long as the container runs."""
    return [container[kind] for kind in ("readinessProbe", "livenessProbe") if kind in container]


def ask(probe: Mapping[str, Any], port: int) -> None:
    """One probe, as the kubelet does it: a connection, a request, or a process."""
    if "tcpSocket" in probe:
        socket.create_connection(("127.0.0.1", port), 5).close()
    elif "httpGet" in probe:
        connection = http.client.HTTPConnection("127.0.0.1", port, timeout=5)
        connection.request("GET", probe["httpGet"]["path"], headers={"Connection": "close"})
        connection.getresponse().read()
        connection.close()
    else:
        command = probe["exec"]["command"]
        subprocess.run([PYTHON if command[0] == "python3" else command[0], *command[1:]], check=False)  # noqa: S603


def cost_of(action: Callable[[], Any], pid: int | None, times: int) -> float:
    """Seconds of processor that one takes of a process; without one, of the processes that it starts."""

    def used() -> float:
        if pid is not None:
            return cpu_seconds(pid)
        found = resource.getrusage(resource.RUSAGE_CHILDREN)
        return found.ru_utime + found.ru_stime

    before = used()
    for _time in range(times):
        action()
    time.sleep(0.5)  # until what they began has ended
    return (used() - before) / times


def probing(container: Mapping[str, Any], pid: int, port: int) -> float:
    """Thousandths of a core that its probes take, of the process that answers and of those that are started."""
    share = 0.0
    for probe in probes(container):
        started = "exec" in probe
        one = cost_of(lambda probe=probe: ask(probe, port), None if started else pid, 20 if started else BURST)  # type: ignore[misc]
        share += one * 1000 / probe["periodSeconds"]
    return share


def container(objects: list[dict[str, Any]], name: str) -> Mapping[str, Any]:
    """The first container of a Deployment."""
    found = next(one for one in objects if one["kind"] == "Deployment" and one["metadata"]["name"] == name)
    first: Mapping[str, Any] = found["spec"]["template"]["spec"]["containers"][0]
    return first


# ---- the robot


def specification() -> Robot:
    """Ten apps as a user writes them down, without a readiness command."""
    apps = [{"name": f"app-{number}", "image": "example.org/app:1", "args": ["x"]} for number in range(APPS)]
    return Robot.from_variables({"ros_apps": apps}, "robot1")


def start(scene: ExporterScene) -> list[str]:
    """The master and ten nodes: topics, a service, an action."""
    scene.start_master()
    found = ["/helper", "/worker"]
    for number in range((APPS - 2) // 2):
        scene.start("counted", f"/talker_{number}", f"/topic_{number}", str(HERTZ))
        scene.start("listener", f"/listener_{number}", f"/topic_{number}")
        found += [f"/talker_{number}", f"/listener_{number}"]
    scene.start("service", "/helper")
    scene.start("server", "/worker")
    until("ten nodes", lambda: set(found) <= set(scene.registered()), 120)
    return found


def start_keeper(scene: ExporterScene, robot: Robot) -> subprocess.Popen[bytes]:
    """With an API server beside it, as in its pod: it has a Lease to look at, and TLS in its memory."""
    account = scene.directory / "account"
    account.mkdir()
    server = start_server(account, robot.namespace)
    lease = {"metadata": {"name": "robot-update"}, "spec": {"holderIdentity": ""}}
    server.put(f"/apis/coordination.k8s.io/v1/namespaces/{robot.namespace}/leases/robot-update", lease)
    scene.environment = environment(server)
    return scene.start_keeper("--account", str(account))


def shares(pids: Mapping[str, int], seconds: float) -> dict[str, float]:
    """Thousandths of a core that each process takes over that time."""
    before, began = {name: cpu_seconds(pid) for name, pid in pids.items()}, time.monotonic()
    time.sleep(seconds)
    took = time.monotonic() - began
    return {name: (cpu_seconds(pid) - before[name]) / took * 1000 for name, pid in pids.items()}


def scraping(scene: ExporterScene) -> contextlib.AbstractContextManager[None]:
    """As Prometheus does."""
    return ticking(INTERVAL, lambda: zipped_scrape(scene))


def earlier(scene: ExporterScene) -> float:
    """What asking the master by a new Python every 2 s takes here, which says how fast this core is."""
    code = PROBE.replace(str(names.MASTER_PORT), str(scene.port))
    return cost_of(lambda: ask({"exec": {"command": ["python3", "-c", code]}}, 0), None, 20) * 1000 / EARLIER_PERIOD


def asked_of_the_master(scene: ExporterScene, pid: int) -> float:
    """Thousandths of a core that the keeper's questions take of the master: five minutes of rest, without waiting."""
    now, looks = [time.time()], 60

    def look() -> None:
        now[0] += keeper.REST
        keeping.step()
        if keeping.probing is not None:
            keeping.probing.join()

    record = KeptFiles(str(scene.directory / "another"), print)
    keeping = keeper.Keeper(Registrar(scene.uri, 2.0, "/bench_keeper"), record, print, lambda: now[0])
    look()  # the first learns everything
    return cost_of(look, pid, looks) * 1000 / keeper.REST


def measure(scene: ExporterScene, seconds: float) -> dict[str, Any]:
    """Rows of all parts, and how this core compares."""
    robot = specification()
    objects = [*master_objects(robot), *app_objects(robot)]
    nodes = start(scene)
    master = scene.processes["master"].pid
    time.sleep(5)
    alone, asked_for = shares({"master": master}, seconds)["master"], asked_of_the_master(scene, master)
    keeping = start_keeper(scene, robot).pid
    scene.until_recorded(*nodes)
    time.sleep(keeper.QUIET + 5)
    kept = shares({"keeper": keeping}, seconds)["keeper"]
    asked = xmlrpc.client.ServerProxy(scene.registered()["/helper"].uri)
    one_node = cost_of(lambda: asked.getPid("/bench"), scene.processes["/helper"].pid, BURST)
    rows = [
        Row("master: its own work, with ten nodes", alone, ours=False),
        Row("master: what the keeper asks", asked_for),
        Row("master: its probes", probing(container(objects, names.MASTER_NAME), master, scene.port)),
        Row("keeper", kept, *memory_mb(keeping)),
        Row("keeper: its probes", probing(container(objects, names.KEEPER_NAME), keeping, scene.keeper_port)),
        Row("ten apps: their probes", sum(probing(container(objects, app.name), 0, 0) for app in robot.apps)),
        Row("ten apps: what the keeper asks", one_node * APPS * 1000 / PERIOD),
    ]
    beside = scene.start_code("sidecar").pid
    time.sleep(1)
    took = shares({"sidecar": beside}, seconds)["sidecar"]
    rows.append(Row("one app's hooks in a sidecar, where it has one", took, *memory_mb(beside), ours=False))
    scene.exporter_port = scene.keeper_port
    with scraping(scene):
        time.sleep(3 * INTERVAL)
        took = shares({"keeper": keeping}, seconds)["keeper"]
    rows.append(Row("keeper that is scraped, in its own row's place", took, *memory_mb(keeping), ours=False))
    return {"rows": rows, "earlier": earlier(scene)}


def verdict(found: Mapping[str, Any]) -> dict[str, Any]:
    """The sums, on this core and on the slow one, and whether they are within the limits."""
    ours = [row for row in found["rows"] if row.ours]
    cpu, memory = sum(row.cpu for row in ours), sum(row.rss_mb for row in ours)
    slow = cpu * max(1.0, EARLIER_SHARE / found["earlier"])
    return {
        "cpu": round(cpu, 2),
        "cpu_slow": round(slow, 2),
        "rss_mb": round(memory, 1),
        "limit": LIMIT,
        "limit_mb": LIMIT_MB,
        "earlier_elsewhere": EARLIER_SHARE,
        "passed": slow <= LIMIT and memory <= LIMIT_MB,
    }


def report(found: Mapping[str, Any]) -> str:
    """The table, in words."""
    total = verdict(found)
    lines = [f"{'at rest, with ten apps':<48} {'1/1000 core':>12} {'MB':>6} {'private':>8}"]
    for row in found["rows"]:
        memory = f"{row.rss_mb:>6} {row.private_mb:>8}" if row.rss_mb else f"{'':>6} {'':>8}"
        lines.append(f"{row.part + ('' if row.ours else ' *'):<48} {row.cpu:>12.2f} {memory}")
    lines += [
        f"{'ours together':<48} {total['cpu']:>12.2f} {total['rss_mb']:>6}",
        "* is not in the sum",
        f"A new Python every 2 s, which asked the master before, takes {found['earlier']:.1f} of this core and took "
        f"{EARLIER_SHARE:g} of a robot's:",
        f"ours together is at most {total['cpu_slow']} of that one (limit {LIMIT:g}/1000, {LIMIT_MB:g} MB), "
        f"load {os.getloadavg()[0]:.1f}",
    ]
    return "\n".join(lines)
