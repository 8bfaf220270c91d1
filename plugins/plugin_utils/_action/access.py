# SPDX-License-Identifier: GPL-3.0-or-later
"""The way to a host's cluster: one that is given, or one that is fetched from the cluster's own server for this run.

What is fetched lies in Ansible's own temporary directory of the run, 0600, and goes with it. It is fetched once for
each cluster and run: a hundred agents of one cluster wait for the first of them.
"""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import socket
import time
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from ...module_utils._common.errors import FleetError, KubeError
from .._kube.access import NoClusterError, ServersAwayError, given_options
from .._kube.kubeconfig import is_foreign, keep, local_kubeconfig, url_at
from .._model.fleet import Home
from .._model.topology import EDGE_CLUSTER, address, in_url
from .leftovers import prefix, sweep

LEADING = ("host", "kubeconfig", "context")  # options that say which API
AWAY_SECONDS = 60.0  # a server that could not be reached is not tried again by every robot of its cluster
CONNECT_SECONDS = 5.0
Networks = Mapping[str, Sequence[str]]  # by node
FAILURES = {one.__name__: one for one in (NoClusterError, ServersAwayError, KubeError)}


@dataclass(frozen=True)
class Way:
    """Options of kubernetes.core, whether the environment adds to them, and whence they are.

    `own`: they were fetched from the cluster's own server.
    """

    options: Mapping[str, Any]
    environment: bool
    source: str
    own: bool = False


def given_way(params: Mapping[str, Any], path: str, environ: Mapping[str, str], cluster: str) -> Way | None:
    """The way that somebody gave: the task's options, the environment, or `path` (k3s_kubeconfig_path).

    The environment holds one access, so it counts for the cluster `edge` alone: a standalone robot has its own.
    """
    options = given_options(params)
    shared = cluster == EDGE_CLUSTER
    if any(options.get(name) for name in LEADING):
        return Way(options, shared, "the task's options")
    found = [name for name in (f"K8S_AUTH_{option.upper()}" for option in LEADING) if environ.get(name)]
    if shared and found:
        return Way(options, True, f"{' and '.join(found)} of the environment")
    place = Path(path).expanduser() if path else None
    if place and is_foreign(str(place)):  # what a run wrote there itself is for kubectl
        return Way({**options, "kubeconfig": str(place)}, False, f"k3s_kubeconfig_path, {path}")
    return None


def accepts(host: str, port: int) -> bool:
    """Whether something listens there."""
    try:
        socket.create_connection((host.strip("[]"), port), CONNECT_SECONDS).close()
    except OSError:
        return False
    return True


@dataclass(frozen=True)
class Fetch:
    """Fetches kubeconfigs into `directory`. `read` gives a server's k3s.yaml, or raises one of FAILURES."""

    directory: Path
    read: Callable[[str], str]
    accepts: Callable[[str, int], bool] = accepts
    wall: Callable[[], float] = field(default=time.time)
    say: Callable[[str], None] = lambda _text: None

    def way(self, home: Home, hostvars: Mapping[str, Any], options: Mapping[str, Any]) -> Way:
        """The way to a cluster, by the first of its servers that is there and serves."""
        path = self._path(home.part.cluster, "yaml")
        with self._alone(home.part.cluster):
            if not path.exists():
                sweep(self.directory)
                self._refuse_again(home.part.cluster)
                try:
                    keep(str(path), self._kubeconfig(home, hostvars))
                except FleetError as error:
                    self._remember(home.part.cluster, error)
                    raise
        return Way({**options, "kubeconfig": str(path)}, False, "the cluster's own server", own=True)

    def forget(self, cluster: str) -> None:
        """Fetch it anew the next time: the cluster was made anew meanwhile."""
        with self._alone(cluster):
            self._path(cluster, "yaml").unlink(missing_ok=True)

    def _kubeconfig(self, home: Home, hostvars: Mapping[str, Any]) -> str:
        """Of a server that serves; of one that does not, where there is no other.

        One lost packet must not put off all robots of a cluster: where no server tells, each is asked once more.
        """
        problems: dict[str, FleetError] = {}
        servers, second = home.part.servers, ""
        for number, server in enumerate([*servers, *servers]):
            if number == len(servers) and second:
                break
            if isinstance(problems.get(server), NoClusterError):  # that is no hiccup
                continue
            try:
                text = self.read(server)
                front = hostvars[server].get("k3s_api_endpoint") if server in hostvars else ""  # of all servers
                url = url_at(text, in_url(str(front or "")) or address(server, hostvars))
                found = local_kubeconfig(text, url, home.part.cluster)
            except FleetError as error:
                if server not in problems:
                    self.say(f"the cluster {home.part.cluster} gives no access on its server {server}: {error}")
                problems[server] = error
                continue
            parts = urlsplit(url)
            if self.accepts(str(parts.hostname), parts.port or 443):
                return found
            second = second or found
        if second:
            return second
        raise _together(home.part.cluster, problems)

    def _refuse_again(self, cluster: str) -> None:
        try:
            found = json.loads(self._path(cluster, "failed").read_text("utf-8"))
        except (OSError, ValueError):
            return
        if self.wall() - float(found["at"]) < AWAY_SECONDS:
            raise FAILURES[found["kind"]](found["message"])

    def _remember(self, cluster: str, error: FleetError) -> None:
        kind = type(error).__name__ if type(error).__name__ in FAILURES else KubeError.__name__
        note = {"kind": kind, "message": str(error), "at": self.wall()}
        self._path(cluster, "failed").write_text(json.dumps(note), "utf-8")

    def _path(self, cluster: str, kind: str) -> Path:
        return self.directory / f"{prefix()}{cluster}.{kind}"

    def networks(self, cluster: str, nodes: Collection[str], ask: Callable[[], Networks]) -> Networks:
        """From where hosts send: what was asked for once in this run, and again for nodes that have joined since."""
        path = self._path(cluster, "networks")
        with self._alone(cluster):
            found: Networks = json.loads(path.read_text("utf-8")) if path.exists() else {}
            if not {*nodes} <= found.keys():
                found = ask()
                path.write_text(json.dumps(found), "utf-8")
        return found

    @contextlib.contextmanager
    def _alone(self, cluster: str) -> Iterator[None]:
        handle = os.open(self._path(cluster, "lock"), os.O_RDWR | os.O_CREAT, 0o600)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX)
            yield
        finally:
            os.close(handle)


def _together(cluster: str, problems: Mapping[str, FleetError]) -> FleetError:
    """One error of those of all servers. That k3s is not there yet counts only where every server says so."""
    said = "; ".join(f"{server}: {error}" for server, error in problems.items())
    kinds = {type(error) for error in problems.values()}
    if kinds == {NoClusterError}:
        return NoClusterError(
            f"There is no cluster {cluster} yet ({said}); the stage k3s of rosops.fleet.site makes it"
        )
    if kinds == {ServersAwayError}:
        return ServersAwayError(
            f"No server of the cluster {cluster} can be reached over SSH, where a run fetches its access to it; "
            f"each was tried twice ({said})"
        )
    return KubeError(f"There is no access to the cluster {cluster}: {said}")
