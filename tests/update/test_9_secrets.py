# SPDX-License-Identifier: GPL-3.0-or-later
"""Who looks over the shoulder of a run: its screen and files, all process lists, the logs of hosts, and each file that
one who is not root can read there, and what AWX keeps of a job. Secrets of the inventory are planted, those of the
cluster are read from its disks.
"""

from __future__ import annotations

import base64
import json
import secrets
import shlex
import threading
from collections.abc import Iterator, Mapping
from pathlib import Path

import pytest
from awx_job import Ended
from fleet import LIMIT, Fleet, Variables
from runs import Run
from test_8_awx import ROBOT1, Controller

APP = "temperature"
HOSTS = ("edge1", "robot1")
SERVER, AGENT = "/var/lib/rancher/k3s/server", "/var/lib/rancher/k3s/agent"
# what a host holds of the cluster: what prints one secret a line
HELD = {
    "edge1": {
        "the servers' token": "cat /etc/rancher/k3s/token",
        "the agents' token": "cat /etc/rancher/k3s/agent-token",
        "the administrator's key": f"sed -n 3p {SERVER}/tls/client-admin.key",
        "the key of the certificates": f"sed -n 3p {SERVER}/tls/server-ca.key",
        "the key of accounts' tokens": f"sed -n 3p {SERVER}/tls/service.key",
        "the key of Secrets": f'grep -o \'"secret":"[^"]*\' {SERVER}/cred/encryption-config.json | cut -d\'"\' -f4',
    },
    "robot1": {
        "the robot's token": "cat /etc/rancher/k3s/agent-token",
        "the kubelet's key": f"sed -n 3p {AGENT}/client-kubelet.key",
        "the network's key": f"sed -n 3p {AGENT}/client-kube-proxy.key",
        "the kubelet's own key": f"sed -n 3p {AGENT}/serving-kubelet.key",
        "the node's password": "cat /etc/rancher/node/password",
        "the keeper's token": "cat /var/lib/kubelet/pods/*/volumes/kubernetes.io~projected/*/token | head -1",
    },
}
KINDS = ("password", "token", "key", "address", "parameter", "line of a file", "JSON of a file", "login", "proxy")
WRITTEN = ("/etc", "/var", "/run", "/tmp", "/root", "/home", "/opt", "/srv")  # noqa: S108 - as below
OF_A_RUN = ("/tmp", "/var/tmp", "/var/log", "/root/.ansible", "/home")  # noqa: S108 - looked through, not written to


def planted(fleet: Fleet, secret: Mapping[str, str]) -> Variables:
    """An inventory with these; robot1's publisher has most of them."""
    env = {
        "MQTT_PASSWORD": secret["password"],
        "CLOUD_TOKEN": secret["token"],
        "CLOUD_SECRET_KEY": secret["key"],
        "BROKER": f"mqtt://robot:{secret['address']}@broker",
    }
    auths = json.dumps({"auths": {"registry.example": {"auth": secret["JSON of a file"]}}})
    files = [
        {"path": "/etc/broker.conf", "content": f"password={secret['line of a file']}\n"},
        {"path": "/etc/auths.json", "content": auths},
    ]
    params = {"cloud/password": secret["parameter"]}
    login = {"name": "pull", "registry": "registry.example", "username": "robot", "password": secret["login"]}
    return {
        **fleet.new_version("robot1", APP, fleet.changed("robot1", APP, params=params, files=files), **env),
        "robot_namespace_pull_secrets": [login],
        "k3s_environment": {"PROXY_PASSWORD": secret["proxy"]},
    }


class ProcessLists:
    """All command lines on this machine, and so in the lab's hosts and their pods, until it is closed."""

    def __init__(self) -> None:
        self.lines: set[bytes] = set()
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._look)

    def __enter__(self) -> ProcessLists:
        self._thread.start()
        return self

    def __exit__(self, *_error: object) -> None:
        self._end.set()
        self._thread.join()

    def _look(self) -> None:
        while not self._end.wait(0.05):
            for path in Path("/proc").glob("[0-9]*/cmdline"):
                try:
                    self.lines.add(path.read_bytes())
                except OSError:  # it has ended
                    continue


def forms(secret: str) -> list[str]:
    """As it is, and as Kubernetes and registries write it."""
    return [secret, base64.b64encode(secret.encode()).decode().rstrip("=")[:-1]]


def on_host(fleet: Fleet, host: str, every: Mapping[str, str]) -> Iterator[str]:
    """Files in which one of them can be read by nobody, or which a run and the host's logs leave."""
    words = "\n".join(form for secret in every.values() for form in forms(secret))
    kept = "/run/rosops-planted"  # which only root reads, so that no process list has them
    fleet.hosts.ssh(host, f"umask 077; cat >{kept}", words)
    nobody = "setpriv --reuid=65534 --regid=65534 --clear-groups"
    readable = f"{nobody} find {shlex.join(WRITTEN)} -xdev -type f -readable -size -2M -print0 2>/dev/null"
    try:
        yield from fleet.hosts.ssh(host, f"{readable} | xargs -0 -r grep -lF -f {kept} -- || true").splitlines()
        yield from fleet.hosts.ssh(host, f"grep -rlF -f {kept} {shlex.join(OF_A_RUN)} 2>/dev/null || true").splitlines()
        told = fleet.hosts.ssh(host, f"journalctl --no-pager -o cat | grep -cF -f {kept} || true").strip()
        if told != "0":
            yield f"{told} lines of the journal"
    finally:
        fleet.hosts.ssh(host, f"rm {kept}")


def of_run(run: Run, folder: Path) -> dict[str, str]:
    """What a run has printed and written on the control node, by where that is."""
    said = {"the screen": run.output}
    for path in (*folder.rglob("*"), *Path.home().joinpath(".ansible").rglob("*")):
        if path.is_file() and not path.name.endswith(".vars.yml"):
            said[str(path)] = path.read_bytes().decode("utf-8", "replace")
    return said


def of_job(job: Ended) -> dict[str, str]:
    """What AWX keeps of one."""
    events = {f"event {number}, {event['event']}": json.dumps(event) for number, event in enumerate(job.events)}
    return {"the job's output": job.output, "its artifacts": json.dumps(job.artifacts), **events}


def shown(said: Mapping[str, str], every: Mapping[str, str]) -> dict[str, list[str]]:
    """Secret -> where it is seen."""
    found = {
        kind: [where for where, text in said.items() if any(form in text for form in forms(secret))]
        for kind, secret in every.items()
    }
    return {kind: where for kind, where in found.items() if where}


@pytest.fixture
def put_back(fleet: Fleet) -> Iterator[None]:
    before = dict(fleet.variables)
    yield
    fleet.playbooks.run("site", before, *LIMIT).must(0)
    fleet.return_to(before)


@pytest.mark.long
@pytest.mark.promise("no secret is on a screen, a process list, in a log, or in a file that others may read")
@pytest.mark.usefixtures("put_back")
def test_no_secret_is_seen(fleet: Fleet, tmp_path: Path) -> None:
    of_inventory = {kind: f"Hush{secrets.token_hex(12)}" for kind in KINDS}
    wanted = planted(fleet, of_inventory)
    with ProcessLists() as lists:
        foreseen = fleet.playbooks.run("site", wanted, *LIMIT, "--check", "--diff", "-vvvv")
        run = fleet.playbooks.run("site", wanted, *LIMIT, "--diff", "-vvvv")
        newer = fleet.new_version("robot1", APP, wanted)
        job = Controller(fleet, tmp_path).run("site", newer, limit=ROBOT1, verbosity=4)
    assert (foreseen.status, run.status) == (0, 0), f"{foreseen}\n{run}"
    assert job.outcomes["robot1"] == "updated"
    held = {what: fleet.hosts.ssh(host, how).strip() for host, told in HELD.items() for what, how in told.items()}
    assert len({*held.values(), *of_inventory.values()}) == len(held) + len(KINDS) > 20, "some are not there"
    assert min(map(len, held.values())) > 15
    every = {**held, **of_inventory}
    (pod,) = fleet.pods()["robot1"][APP]
    assert of_inventory["password"] in fleet.cluster.execute("robot1", pod.name, "env")  # they have come to be there

    listed = [kind for kind, secret in every.items() if any(secret.encode() in line for line in lists.lines)]
    files = {host: [*on_host(fleet, host, every)] for host in HOSTS}
    fleet.figures.append(f"{len(every)} secrets, {len(lists.lines)} command lines: {listed}, {files}")
    assert len(lists.lines) > 100
    assert (listed, files) == ([], {host: [] for host in HOSTS})
    assert len(job.events) > 10
    for said in (of_run(foreseen, fleet.playbooks.directory), of_run(run, fleet.playbooks.directory), of_job(job)):
        assert shown(said, every) == {}
