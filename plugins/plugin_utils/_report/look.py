# SPDX-License-Identifier: GPL-3.0-or-later
"""A look at the fleet, first at its clusters, then at its graphs -> how it stands; who is off, which cluster can be
asked, and who reads whose ROS graph. Clusters are asked side by side: one that does not answer keeps nobody from the
others.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field, replace
from itertools import chain

from ...module_utils._common.errors import FleetError, KubeError
from ...module_utils._step.objects import Object, labels_of, name_of
from .._kube.client import Kube
from .._kube.door import KeeperDoor
from .._kube.pods import meta
from .._kube.running import outdated
from .._model import names
from .._model.context import Robot, master_namespace
from .._model.fleet import Fleet
from .._model.formats import FORMS
from .._objects.pod_settings import promised
from .._update.outcome import EVENTS_NAME
from . import held, ros_graph, rows
from .attention import attention
from .host_run import SPOILT
from .kept import REF
from .results import Result, message_of
from .ros_graph import Graphs, apps_of
from .rows import SHARED, Promise, Status, Trouble, Workload

SECONDS = 60.0
MOST_AT_ONCE = 16
# Kind and label selector. Nothing is asked for that is not shown.
KINDS = {
    "Node": "",
    "Deployment": f"app.kubernetes.io/managed-by={names.MANAGER}",
    "Pod": names.LABEL_APP,
    "PersistentVolumeClaim": "",
    "Service": "",
    "StorageClass": "",
}
MAPS = {REF.name: REF.namespace, EVENTS_NAME: ""}  # ConfigMaps, and where; all of them together are megabytes
TIMED_OUT = (124, 137)  # how timeout(1) ends after SIGTERM, and after SIGKILL
# how graphs are read; nobody's camera begins to encode because somebody looks. The same as in playbooks/status.yml
RATES = {"rates": True, "rate_source": "counters", "rate_seconds": 4.0}
# What a robot measures: local-path's directories are <volume>_<namespace>_<claim>.
_USAGE = re.compile(r"(\d{1,18})\s+(?:.*/)?[^/_]+_([^/_]+)_([^/]+)", re.ASCII)


@dataclass(frozen=True)
class Asked:
    """Whose graph a robot reads, at which master, the addresses of the pods that may be in it, and what is promised."""

    robot: str
    master_uri: str = ""
    addresses: tuple[str, ...] = ()
    promised: ros_graph.Promises = field(default_factory=dict)


@dataclass(frozen=True)
class Look:
    """What the clusters said: sections of the status, and which robots are to read which graphs."""

    status: Status
    graphs: Mapping[str, Asked] = field(default_factory=dict)
    name: str = ""


def status_of(seen: Status, graphs: Graphs, more: Iterable[Trouble] = ()) -> Status:
    """All sections, with the ROS graphs by robot, and more problems."""
    crashes, ended = ros_graph.launched_rows(seen.apps, graphs)
    return replace(
        seen,
        problems=(*seen.problems, *more, *held.ending_rows(seen.workloads), *crashes),
        ended=tuple(ended),
        ros_nodes=tuple(ros_graph.node_rows(graphs, seen.workloads, seen.nodes)),
        topics=tuple(ros_graph.topic_rows(graphs)),
        links=tuple(ros_graph.links(graphs)),
    )


# ---- clusters


@dataclass
class Answer:
    """The objects of a cluster by kind, and why there are no more of them (empty: these are all)."""

    objects: dict[str, list[Object]] = field(default_factory=dict)
    problem: str = ""


def ask(opened: Mapping[str, Callable[[], Kube]], seconds: float = SECONDS) -> dict[str, Answer]:
    """The answer of each cluster, by its name; `opened` connects to it, or raises one of our errors."""
    answers = dict.fromkeys(opened, Answer(problem=f"no answer within {seconds:.0f} s"))
    pool = ThreadPoolExecutor(MOST_AT_ONCE)
    # All are opened before any is closed: the client's temporary files of keys go with the first that is closed.
    with ExitStack() as open_ones:
        running = {}
        for cluster, connect in opened.items():
            try:
                running[cluster] = pool.submit(_read, open_ones.enter_context(connect()))
            except FleetError as error:
                answers[cluster] = Answer(problem=str(error))
        wait(running.values(), timeout=seconds)
        answers |= {cluster: one.result() for cluster, one in running.items() if one.done()}
        pool.shutdown(wait=False, cancel_futures=True)
    return answers


def _read(kube: Kube) -> Answer:
    answer = Answer()
    try:
        for kind, labels in KINDS.items():
            answer.objects[kind] = kube.objects(kind, labels=labels)
        maps = (kube.objects("ConfigMap", where, fields=f"metadata.name={name}") for name, where in MAPS.items())
        answer.objects["ConfigMap"] = [*chain.from_iterable(maps)]
    except (KubeError, *SPOILT) as error:
        answer.problem = str(error)
    return answer


def believed(answer: Answer, robot: str, now: float) -> Answer:
    """Of a robot's own cluster: what it says of that robot, or nothing where that makes no sense.

    Whoever is root there is its API server, too. He could speak for other robots, keep the status from all of them, or
    have a name that is a command in what an operator is told to run.
    """
    try:
        objects = {kind: [one for one in found if _is_own(one, robot)] for kind, found in answer.objects.items()}
        for one in objects.get("ConfigMap", ()):
            if name_of(one) == REF.name:
                one["data"] = {host: text for host, text in (one.get("data") or {}).items() if host == robot}
        attention(held.cluster_rows([objects], {}, now))
        list(outdated(objects.get("Pod", ()), lambda _node, _image: ()))
    except SPOILT as error:
        return Answer(problem=f"what it says makes no sense: {type(error).__name__}: {error}")
    return replace(answer, objects=objects)


def _is_own(one: Object, robot: str) -> bool:
    """Whether an object has a name that is one, and is of this robot, or of none."""
    said = {key: str(meta(one).get(key) or "") for key in ("name", "namespace")}
    named = all(FORMS["dns-name"].test(text) for text in said.values() if text) and bool(said["name"])
    return named and labels_of(one).get(names.LABEL_ROBOT, robot) == robot


# ---- hosts


@dataclass(frozen=True)
class Member:
    """A host of this run, with the servers of its cluster and the robot that it is."""

    row: rows.Host
    servers: tuple[str, ...]
    robot: Robot | None = None

    @property
    def graph(self) -> str:
        """Whose ROS graph the robot's is. A robot that is a cluster of its own shares with nobody."""
        shared = self.robot is not None and self.robot.master.mode == "shared" and self.servers != (self.row.name,)
        return SHARED if shared else self.row.name


def members(fleet: Fleet, addresses: Mapping[str, str], results: Mapping[str, Result]) -> list[Member]:
    """The hosts of a run, by their addresses; `results` are theirs of a task that ran on all of them."""
    away = {name: message_of(result) for name, result in results.items() if result.get("unreachable")}
    found = []
    for name, address in addresses.items():
        part, robot = fleet.hosts[name], fleet.robots.get(name)
        group = "robots" if robot else "edge"
        row = rows.Host(name, group, address, part.role, part.cluster, name not in away, away.get(name, ""))
        found.append(Member(row, part.servers, robot))
    return found


def clusters_of(hosts: Sequence[Member]) -> tuple[dict[str, str], dict[str, str]]:
    """Each cluster that can be asked with a host of it, and why the others cannot. A server that is off would be
    waited for; one that this run does not have may be up."""
    asked: dict[str, str] = {}
    silent: dict[str, str] = {}
    up = {host.row.name: host.row.reachable for host in hosts}
    for host in hosts:
        servers = [up[name] for name in host.servers if name in up]
        if servers and not any(servers):
            silent[host.row.cluster] = "its servers are unreachable"
        else:
            asked.setdefault(host.row.cluster, host.row.name)
    return asked, silent


def cluster_problems(silent: Mapping[str, str], hosts: Sequence[Member]) -> list[Trouble]:
    """What is told of clusters that do not answer; `cluster` says which hosts' being off explains it."""
    by_cluster = {host.row.cluster: host.row.name for host in hosts if host.row.role == "server"}
    look = "ansible {} -b -a 'systemctl status k3s'"
    return [
        Trouble(f"cluster {name}", f"does not answer: {why}", look.format(by_cluster.get(name, name)), cluster=name)
        for name, why in silent.items()
    ]


def graphs_to_read(
    hosts: Sequence[Member], services: Mapping[str, Sequence[Object]], apps: Sequence[Workload]
) -> dict[str, Asked]:
    """Which robot reads whose graph.

    A shared master's graph is all robots': the first of them that answers reads it. `services` are each cluster's.
    """
    found: dict[str, Asked] = {}
    taken = set()
    for host in hosts:
        if host.robot is None or not host.row.reachable or host.graph in taken:
            continue
        uri = _master_uri(host.robot, services.get(host.row.cluster, ()))
        if uri:
            taken.add(host.graph)
            pods = {address for row in apps_of(host.graph, apps) for address in row.addresses}
            rates = promised_rates((one for one in hosts if one.graph == host.graph), apps)
            found[host.row.name] = Asked(host.graph, uri, tuple(sorted(pods)), rates)
    return found


def read_by_keepers(
    graphs: Mapping[str, Asked], hosts: Sequence[Member], opened: Mapping[str, Callable[[], Kube]]
) -> dict[str, Result]:
    """What their keepers say of these graphs, as results of ros_graph_info, by robot.

    All at once, through the API servers of the robots' clusters: `opened` has those whose hosts are there. One that is
    not answered is left out: it is for the robot's own host.
    """
    found: dict[str, Result] = {}
    ours = {host.row.name: (host.robot, host.row.cluster) for host in hosts if host.robot and host.row.name in graphs}
    with ThreadPoolExecutor(max(len(ours), 1)) as pool, ExitStack() as open_ones:
        kubes = {}
        for cluster in {cluster for _robot, cluster in ours.values()} & opened.keys():
            with suppress(FleetError):
                kubes[cluster] = open_ones.enter_context(opened[cluster]())
        running = {
            name: pool.submit(_read_by_keeper, kubes[cluster], robot, graphs[name])
            for name, (robot, cluster) in ours.items()
            if cluster in kubes
        }
        for name, one in running.items():
            with suppress(KubeError):
                found[name] = one.result()
    return found


def _read_by_keeper(kube: Kube, robot: Robot, asked: Asked) -> Result:
    door = KeeperDoor(kube, master_namespace(robot), robot.namespace, "")
    return dict(door.job("graph", {**RATES, "launch_hosts": list(asked.addresses)}))


def promised_rates(hosts: Iterable[Member], apps: Iterable[Workload]) -> dict[str, Promise]:
    """What apps' readiness says of topics' rates, by topic; nothing is promised by apps that are not there yet."""
    there = {(row.robot, row.name) for row in apps}
    found = {}
    for host in hosts:
        for topic, app, said in promised(host.robot) if host.robot else ():
            owner = host.row.name if app.scope == "robot" else SHARED
            if (rate := said.get("min_rate")) and (owner, app.name) in there:
                found[topic] = Promise(rate, app.name, owner)
    return found


def _master_uri(robot: Robot, services: Iterable[Object]) -> str:
    """Where a host of the cluster reaches the robot's master; empty where there is none."""
    if not robot.master.ours:
        return robot.master.uri
    wanted = (master_namespace(robot), names.MASTER_NAME)
    own = (one.get("spec") or {} for one in services if (meta(one).get("namespace"), name_of(one)) == wanted)
    found = (str(spec.get("clusterIP")) for spec in own)
    return next((f"http://{one}:{names.MASTER_PORT}" for one in found if FORMS["addresses"].test(one)), "")


def unmeasured(results: Mapping[str, Result]) -> list[Trouble]:
    """Hosts whose volumes took longer to measure than `timeout` gave them: what is known of them is not all."""
    what = "measuring what they hold took too long; some have no number"
    todo = "ansible-playbook rosops.fleet.status -e status_storage_seconds=120"
    slow = [host for host, result in results.items() if result.get("rc") in TIMED_OUT]
    return [Trouble(f"volumes of {host}", what, todo) for host in slow]


def usage_of(results: Mapping[str, Result], robots: Collection[str]) -> dict[str, int]:
    """Bytes by `<namespace>/<claim>`, from what `du -sb` said on the hosts; of a robot's host those of that robot."""
    told = [(host, line) for host, result in results.items() for line in str(result.get("stdout") or "").splitlines()]
    lines = [(host, found) for host, line in told if (found := _USAGE.fullmatch(line))]
    return {
        f"{found[2]}/{found[3]}": int(found[1])
        for host, found in lines
        if host not in robots or found[2] == names.robot_namespace(host)
    }
