# SPDX-License-Identifier: GPL-3.0-or-later
"""What action plugins on a cluster share: the access to the right one, check mode without one, the result of writes."""

from __future__ import annotations

import contextlib
import os
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, ClassVar

from ansible import constants as C  # noqa: N812 - its customary name

from ...module_utils._common.documents import Arguments, Result, Variables
from ...module_utils._common.errors import KubeError
from ...module_utils._host.k3s import KUBECONFIG
from ...module_utils._step.objects import Object
from .._kube.access import (
    ACCESS_ARGS,
    IDENTITY,
    Identity,
    NoClusterError,
    ServersAwayError,
    WrongClusterError,
    access_from,
    given_options,
    identity_in,
    to_be_adopted,
)
from .._kube.applied import Applied, diff_of
from .._kube.client import Kube, ref_of
from .._kube.connection import PATIENCE, ApiError
from .._model.fleet import UNNAMED, Home, home_from_vars, home_of
from .._model.host_variables import HostVariables
from .._upstream import ansible_core
from .access import Fetch, Way, given_way
from .base import FleetAction
from .voice import display

BEGIN, END = "rosops-fleet-begin", "rosops-fleet-end"


class ClusterAction(FleetAction):
    """An action on the cluster's API, from the control node, in the process of the task.

    Options are those of the access, as kubernetes.core has them, and those in ARGUMENTS. Where check mode has no
    cluster to compare with, because the run would make it first, `foresee` says what would be done.
    """

    _requires_connection = False
    ACCESS: ClassVar = ACCESS_ARGS
    # Users call it by itself, too, without a fleet: then the options count as kubernetes.core's do, and nothing says
    # which cluster is the right one.
    of_users: ClassVar[bool] = False
    adoption: Identity | None = None  # what the cluster is and does not say yet

    def perform(self, params: Arguments, known: Variables) -> Result:
        self._apis: dict[str, dict[str, str]] = {}
        # The task's `environment`, which a module would find in its own. This process, too, is of one task alone.
        environment: dict[str, Any] = {}
        self._compute_environment_string(environment)
        os.environ.update({str(key): str(value) for key, value in environment.items()})
        try:
            result = self.work(params, known)
        except NoClusterError:
            if not self._task.check_mode:
                raise
            return self.foresee(params, known)
        return {**result, **({"apis": self._apis} if self._apis else {})}  # which API it was, for the report

    def foresee(self, _params: Arguments, _known: Variables) -> Result:
        """The task's result in check mode, where there is no cluster yet."""
        return {"changed": False, "skipped": True, "msg": "there is no cluster yet"}

    @contextlib.contextmanager
    def cluster(self, params: Arguments, known: Variables, patience: float = PATIENCE) -> Iterator[Kube]:
        """The host's cluster, once it is known to be the inventory's; WrongClusterError where it is another one.

        SpecError without a validated fleet: there is nothing to compare with then.
        """
        home = home_from_vars(known) if self.of_users else home_of(known)
        path = str(self._templar.template(known.get("k3s_kubeconfig_path")) or "")
        with self.opened(home, path, known, params) if home else Kube(params, say=self.say(known)) as kube:
            yield kube.within(patience)

    def opened(self, home: Home, path: str, known: Variables, params: Arguments, patience: float = PATIENCE) -> Kube:
        """An open connection to a cluster of the fleet; `path` is the k3s_kubeconfig_path of its hosts."""
        way = self.way(home, path, known, params)
        try:
            return self._compared(way, home, known, patience)
        except ApiError as error:
            if not (way.own and error.misfit):
                raise
        # made anew since it was fetched
        self._fetch(known).forget(home.part.cluster)
        return self._compared(self.way(home, path, known, params), home, known, patience)

    def way(self, home: Home, path: str, known: Variables, params: Arguments) -> Way:
        """The way to the cluster, given or fetched; nothing is asked of the cluster itself."""
        given = given_way(params, path, os.environ, home.part.cluster)
        hostvars = HostVariables(known.get("hostvars") or {})
        return given or self._fetch(known).way(home, hostvars, given_options(params))

    def _fetch(self, known: Variables) -> Fetch:
        return Fetch(Path(C.DEFAULT_LOCAL_TMP), lambda server: self._read(known, server), say=self.say(known))

    def _compared(self, way: Way, home: Home, known: Variables, patience: float) -> Kube:
        """An open connection to a cluster that says to be the host's."""
        kube = Kube(access_from(way.options, way.environment, way.source), patience, self.say(known))
        try:
            where = f"{kube.host} (from {way.source})"
            if not (way.own or home.fleet):
                raise WrongClusterError(
                    f"{where} is an access that was given, and the inventory has no fleet_name by which to tell "
                    "whether it leads to the right cluster. Nothing was read or changed. Set fleet_name for all hosts, "
                    "and run the stage node of rosops.fleet.site once without this access."
                )
            wanted = Identity(home.fleet or UNNAMED, home.part.cluster)
            if to_be_adopted(identity_in(kube.get(IDENTITY)), wanted, way.own, where):
                self.adoption = wanted
        except BaseException:
            kube.close()
            raise
        self._apis[home.part.cluster] = {"host": kube.host, "source": way.source}
        display.vv(f"cluster {home.part.cluster}: {where}")
        return kube

    def _read(self, known: Variables, server: str) -> str:
        """A server's own kubeconfig, read as root; its host may be outside of --limit.

        Ansible's own executor does it: whatever an inventory says about connections, keys and privileges holds. Neither
        the output nor a failure is shown, at no verbosity.
        """
        # that there is none is told by words, which in a locale of its own are others
        command = {"ansible.builtin.raw": f"echo {BEGIN}; env LC_ALL=C cat {KUBECONFIG}; echo {END}"}
        task = {**command, "delegate_to": server, "become": True, "no_log": True, "check_mode": False}
        found = ansible_core.run_task(self, known, task)
        said = f"{found.get('stdout') or ''}{found.get('stderr') or ''}"
        if found.get("unreachable"):
            raise ServersAwayError(" ".join(str(found.get("msg") or "unreachable").split()))
        # a shell may say something before, and ssh something after it: of files that are not there, too
        text, end, _after = said.partition(BEGIN)[2].partition(END)
        if not end or "apiVersion:" not in text:
            if re.search(rf"{KUBECONFIG}'?: No such file", said):
                raise NoClusterError(f"it has no {KUBECONFIG}")
            why = " ".join(f"{found.get('msg') or ''} {said}".replace(BEGIN, "").replace(END, "").split())
            raise KubeError(f"{KUBECONFIG} cannot be read there: {why[:300]}")
        return text


def written(done: Sequence[Applied]) -> Result:
    """The result of a task that wrote objects."""
    return {"changed": any(one.changed for one in done), "diff": diff_of(done)}


def foreseen(objects: Sequence[Object]) -> Result:
    """The same where there is no cluster yet: all of it would be new. The diff names it."""
    names = [str(ref_of(obj)) for obj in objects]
    return {
        "changed": bool(names),
        "diff": {"before": "", "after": "".join(f"{name}\n" for name in names)},
        "msg": f"there is no cluster yet; would create {', '.join(names) or 'nothing'}",
    }
