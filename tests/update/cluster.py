# SPDX-License-Identifier: GPL-3.0-or-later
"""What the cluster and the hosts show, read past the collection: its own client, its own ssh."""

from __future__ import annotations

import json
import shlex
import subprocess
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import evidence
import urllib3
from kubernetes import client, config
from kubernetes.stream import stream
from runs import CHECKOUT, wait_until

LAB = CHECKOUT / "tests" / "lab" / "lab"
APP, UPDATING, SOAKING = "rosops.fleet/app", "rosops.fleet/updating", "rosops.fleet/soaking"
GATE = "rosops.fleet/ready"
MASTER, KEEPER, CODE = "ros-master", "ros-keeper", "rosops-code"
# Claims on the robot and at the edge (molecule/update/inventory), in local-path's directory names.
STORAGE = "/var/lib/rancher/k3s/storage"
SENSOR, EDGE = "sensor-volume-pvc", "edge-volume-pvc"
ASK = "import json, os, xmlrpc.client as x; print(json.dumps(x.ServerProxy(os.environ['ROS_MASTER_URI']).{}[2]))"
TAIL = 6_000_000  # bytes of a log that are read: some twenty minutes of the fastest one


@dataclass(frozen=True)
class Pod:
    """An app's pod. `containers` are their identities: another one is another process."""

    uid: str
    name: str
    image: str
    revision: str
    template: str  # Kubernetes' hash of it
    address: str
    ready: bool
    going: bool
    containers: tuple[str, ...]
    ended: str  # how one of its containers did last, if it was started again
    gate: str  # what the keeper says of it, where it has a readiness gate

    @property
    def version(self) -> str:
        """What is behind the names of its nodes, where versions overlap."""
        return f"{self.revision}_{self.template}"


class Cluster:
    """The shared cluster of the scenario's lab."""

    def __init__(self, kubeconfig: Path) -> None:
        config.load_kube_config(str(kubeconfig))
        self._core, self._apps = client.CoreV1Api(), client.AppsV1Api()

    def pods(self, robot: str) -> dict[str, list[Pod]]:
        """App -> its pods, the master's among them."""
        found: dict[str, list[Pod]] = {}
        for item in self._core.list_namespaced_pod(f"robot-{robot}", _request_timeout=20).items:
            labels = item.metadata.labels or {}
            statuses = item.status.container_statuses or []
            ends = [one.last_state.terminated for one in statuses if one.last_state.terminated]
            said = {one.type: one for one in item.status.conditions or []}
            pod = Pod(
                uid=item.metadata.uid,
                name=item.metadata.name,
                image=item.spec.containers[0].image,
                revision=labels.get("rosops.fleet/revision", ""),
                template=labels.get("pod-template-hash", ""),
                address=item.status.pod_ip or "",
                ready="Ready" in said and said["Ready"].status == "True",
                going=item.metadata.deletion_timestamp is not None,
                containers=tuple(sorted(str(one.container_id) for one in statuses)),
                ended="; ".join(f"{end.reason} ({end.exit_code}) {end.finished_at}" for end in ends),
                gate=str(said[GATE].message) if GATE in said else "",
            )
            found.setdefault(labels.get(APP, item.metadata.name), []).append(pod)
        return found

    def unsettled(self, robot: str) -> list[str]:
        """Why the robot is not at rest; empty when each Deployment is rolled out, proven, and has one pod, ready."""
        deployments = self._apps.list_namespaced_deployment(f"robot-{robot}", _request_timeout=20).items
        pods = self.pods(robot)
        problems = []
        for item in deployments:
            name, status = item.metadata.name, item.status
            if UPDATING in (item.metadata.annotations or {}):
                problems.append(f"{robot}: {name} is marked as unproven")
            if (status.observed_generation, status.updated_replicas) != (item.metadata.generation, 1):
                problems.append(f"{robot}: {name} is not rolled out")
        for app, there in pods.items():
            if [pod.ready and not pod.going for pod in there] != [True]:
                problems.append(f"{robot}: pods of {app}: {there}")
        return problems if deployments else [f"{robot} has no Deployment"]

    def history(self, robot: str, app: str) -> str:
        """The version of what an update keeps of an app's earlier versions; empty before its first update."""
        found = there(lambda: self._core.read_namespaced_config_map(f"{app}-update", f"robot-{robot}"))
        return str(found.metadata.resource_version) if found else ""

    def on_trial(self, robot: str) -> set[str]:
        """Apps that a run or a soak has marked: the keeper writes to them when their time is over."""
        found = self._apps.list_namespaced_deployment(f"robot-{robot}", _request_timeout=20).items
        return {item.metadata.name for item in found if {UPDATING, SOAKING} & {*item.metadata.annotations}}

    def versions(self, robots: list[str]) -> dict[str, str]:
        """The version of each Deployment's specification and of each ConfigMap of these robots."""
        found = {}
        for robot in robots:
            namespace = f"robot-{robot}"
            for item in self._apps.list_namespaced_deployment(namespace, _request_timeout=20).items:
                found[f"{namespace}/{item.metadata.name}"] = str(item.metadata.generation)
            for item in self._core.list_namespaced_config_map(namespace, _request_timeout=20).items:
                found[f"{namespace}/{item.metadata.name}, a ConfigMap"] = str(item.metadata.resource_version)
        return found

    def last_words(self, robot: str, app: str) -> list[str]:
        """How containers of the app that were started again had ended: what they printed last, and the pods' events."""
        found = []
        for pod in self.pods(robot).get(app, []):
            if pod.ended:
                try:
                    log = self._core.read_namespaced_pod_log(
                        pod.name, f"robot-{robot}", previous=True, tail_lines=10, _request_timeout=20
                    )
                except client.ApiException as error:  # the container may be gone with its log
                    log = f"its log cannot be read: {error.reason}"
                found.append(f"{pod.name} {pod.ended}: {log}; {self._events(robot, pod.name)}")
        return found

    def _events(self, robot: str, pod: str) -> str:
        """What the kubelet says that it did with a pod: who ended a container stands nowhere else."""
        try:
            events = self._core.list_namespaced_event(
                f"robot-{robot}", field_selector=f"involvedObject.name={pod}", _request_timeout=20
            )
        except client.ApiException as error:
            return f"its events cannot be read: {error.reason}"
        return "; ".join(f"{item.last_timestamp} {item.reason}: {item.message}" for item in events.items)

    def events(self, robot: str, reason: str) -> list[str]:
        """Pod and message of what happened for this reason."""
        found = self._core.list_namespaced_event(
            f"robot-{robot}", field_selector=f"reason={reason}", _request_timeout=20
        )
        return [f"{item.involved_object.name}: {item.message}" for item in found.items]

    def keeper_log(self, robot: str) -> str:
        """What the robot's keeper has printed."""
        pods = [pod.name for there in self.pods(robot).values() for pod in there if pod.name.startswith(KEEPER)]
        return "".join(self._core.read_namespaced_pod_log(name, f"robot-{robot}", _request_timeout=20) for name in pods)

    def bring_other_code(self, robot: str) -> None:
        """What runs in the robot's pods, as another release of the collection has it."""
        where = (CODE, f"robot-{robot}")
        data = self._core.read_namespaced_config_map(*where, _request_timeout=20).data
        changed = {name: f"{text}# of another release\n" for name, text in data.items() if name.endswith(".py")}
        self._core.patch_namespaced_config_map(*where, {"data": changed}, _request_timeout=20)

    def execute(self, robot: str, pod: str, *command: str) -> str:
        """What a command prints in the pod's app container."""
        call, where = self._core.connect_get_namespaced_pod_exec, (pod, f"robot-{robot}")
        said = stream(call, *where, container="ros-app", command=[*command], stdout=True, stderr=True)
        return str(said)

    def parameters(self, robot: str, pod: str) -> dict[str, Any]:
        """What the parameter server has, asked from a pod with Python; a namespace is a mapping."""
        known = self._asked(robot, pod, "getParam('/test', '/')")
        assert isinstance(known, dict), known
        return known

    def ros_nodes(self, robot: str, pod: str) -> list[str]:
        """The nodes that are registered with the master, asked from a pod with Python."""
        state = self._asked(robot, pod, "getSystemState('/test')")
        return sorted({node for kind in state for _name, nodes in kind for node in nodes})

    def _asked(self, robot: str, pod: str, call: str) -> Any:
        """What the ROS master answers to a pod with Python."""
        return json.loads(self.execute(robot, pod, "python3", "-c", ASK.format(call)))

    def behind(self, robot: str, service: str) -> dict[str, list[str]]:
        """The ports of a Service, and the names of the pods behind it; empty where there is no such Service."""
        found = there(lambda: self._core.read_namespaced_endpoints(service, f"robot-{robot}"))
        return {
            f"{port.name}:{port.port}": sorted(address.target_ref.name for address in subset.addresses or [])
            for subset in (found and found.subsets) or []
            for port in subset.ports
        }

    def delete_pod(self, robot: str, app: str) -> None:
        """As `kubectl delete pod` does."""
        for pod in self.pods(robot)[app]:
            self._core.delete_namespaced_pod(pod.name, f"robot-{robot}")


def ask(
    method: str, path: str, body: Any, headers: Mapping[str, str], certificate: tuple[str, str] | None = None
) -> tuple[int, str]:
    """Status and answer of the API server, for whoever has nothing but this certificate and key, or a token."""
    known = client.Configuration.get_default_copy()
    file, key = certificate or (None, None)
    pool = urllib3.PoolManager(ca_certs=known.ssl_ca_cert, cert_file=file, key_file=key)
    data = None if body is None else json.dumps(body)
    sent = {"Accept": "application/json", "Content-Type": "application/json", **headers}
    answer = pool.request(method, f"{known.host}{path}", body=data, headers=sent, timeout=20.0)
    return answer.status, answer.data.decode()


def bearer(token: str) -> dict[str, str]:
    return {"Authorization": f"Bearer {token}"}


def there(read: Callable[[], Any]) -> Any:
    """What is read, or nothing where it is not there."""
    try:
        return read()
    except client.ApiException as error:
        if error.status == 404:
            return None
        raise


def running(pods: Mapping[str, list[Pod]]) -> dict[str, list[tuple[str, tuple[str, ...]]]]:
    """App -> (UID, containers) of its pods: equal before and after where nothing was touched.

    Not the kubelet's count of restarts: that may grow, too, where a kubelet that has just started does not yet know a
    container's state (`convertToAPIContainerStatuses` of Kubernetes v1.34.2).
    """
    return {app: sorted((pod.uid, pod.containers) for pod in there) for app, there in pods.items()}


class Hosts:
    """The lab's hosts: on and off, and the files that the apps write."""

    def __init__(self, lab: str) -> None:
        self.lab = lab
        listing = subprocess.run([str(LAB), "inventory", "--lab", lab], capture_output=True, text=True, check=True)  # noqa: S603
        found = json.loads(listing.stdout)
        self.variables: dict[str, Any] = found["all"]["vars"]
        self._hosts: dict[str, Any] = found["_meta"]["hostvars"]
        self._edge: str = found["edge"]["hosts"][0]
        self.robots: list[str] = found["robots"]["hosts"]

    def power(self, host: str, word: str) -> None:
        """`down`, `up`, `reboot`, `cut`, `join`."""
        command = [str(LAB), "host", "--lab", self.lab, host, word]
        subprocess.run(command, capture_output=True, text=True, check=True, timeout=300)  # noqa: S603

    def address(self, host: str) -> str:
        return str(self._hosts[host]["ansible_host"])

    def ssh(self, host: str, command: str, text: str | None = None) -> str:
        """What a command, which reads this text, prints on a host."""
        known = self._hosts[host]
        words = ["ssh", "-i", known["ansible_ssh_private_key_file"], *shlex.split(known["ansible_ssh_common_args"])]
        words += ["-o", "ConnectTimeout=10", f"{known['ansible_user']}@{self.address(host)}", command]
        done = subprocess.run(words, input=text, capture_output=True, text=True, check=True, timeout=60)  # noqa: S603
        return done.stdout

    def forget_connections(self) -> None:
        """What was begun with a pod that has ended. It fails who gets the same port in the next two minutes."""
        for host in (self._edge, *self.robots):
            self.ssh(host, "conntrack -D -p tcp --state SYN_SENT; [ $? -le 1 ]")  # 1: there was none

    def processes(self, host: str, uid: str) -> list[int]:
        """Those of a pod by its host's count, but for the one that keeps its namespaces."""
        return self._of_pod(host, uid, "grep -qsvx pause")

    def network(self, host: str, uid: str) -> int:
        """The process that keeps a pod's namespaces, as long as there is the pod. Another one may be a probe's."""
        [number] = self._of_pod(host, uid, "grep -qsx pause")
        return number

    def _of_pod(self, host: str, uid: str, named: str) -> list[int]:
        of_pod = f"grep -Eqs '{uid.replace('-', '[-_]')}' $p/cgroup && {named} $p/comm"
        told = self.ssh(host, f"for p in /proc/[0-9]*; do {of_pod} && echo ${{p#/proc/}}; done; true")
        assert told, f"no process of the pod {uid} on {host}"
        return [int(number) for number in told.split()]

    def signal(self, host: str, uid: str, number: int) -> None:
        """To all processes of a pod; one of the kubelet's probes may have ended by now."""
        self.ssh(host, f"kill -{number:d} {' '.join(map(str, self.processes(host, uid)))} || true")

    def logs(self, robot: str, within: str = "") -> dict[str, list[dict[str, Any]]]:
        """The accounts of a robot's apps, by the file's name: what lies on the robot and what lies at the edge.

        With `within`, a directory of the robot's claim, that of clients on the robot itself stands for the edge's.
        """
        found: dict[str, list[dict[str, Any]]] = {}
        clients = (robot, f"{SENSOR}/{within}") if within else (self._edge, EDGE)
        for host, claim in ((robot, SENSOR), clients):
            files = f"{STORAGE}/*_robot-{robot}_{claim}/*.jsonl"
            text = self.ssh(host, f'for f in {files}; do echo "==> $f"; tail -c {TAIL} "$f"; echo; done')
            for part in text.split("==> ")[1:]:
                path, _newline, lines = part.partition("\n")
                found.setdefault(path.rsplit("/", 1)[-1], []).extend(evidence.parse(lines))
        return found

    def losses(  # noqa: PLR0913 - each has its own way of looking
        self, robot: str, since: float, until: float, goals: bool = True, patience: float = 60, within: str = ""
    ) -> evidence.Losses:
        """What the robot's apps noticed between two times, once every account has come past the second one.

        With `goals` the client has sent a goal after it and has had its answer, so that none before can be lost unseen.
        """
        wanted = {evidence.STATS: "time", evidence.REQUESTS: "time", **({evidence.GOALS: "sent"} if goals else {})}

        seen: dict[str, Any] = {}

        def behind() -> dict[str, float]:
            """How many seconds each account is behind."""
            seen.update(self.logs(robot, within))
            late = {name: until + 0.5 - evidence.newest(seen.get(name, []), key) for name, key in wanted.items()}
            return {name: round(seconds, 1) for name, seconds in late.items() if seconds > 0}

        what = f"accounts of {robot} past the update (seconds behind)"
        wait_until(behind, lambda late: not late, patience, what, pause=1)
        # a sensor that skipped readings may say so later than their subscriber notes what it lacks
        ends = [evidence.newest(seen.get(name, [])) for name in (evidence.STATS, evidence.PUBLISHED)]
        return evidence.losses(seen, since, min(end for end in ends if end > until))
