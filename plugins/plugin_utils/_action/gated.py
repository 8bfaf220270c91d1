# SPDX-License-Identifier: GPL-3.0-or-later
"""What an action has around a change that robots at work may notice: the run's budget, its patience, its outcome.

A robot that works is waited for in looks: the task of the role comes back when all others of the wave had their turn.
What the action has to know then is in the run's ledger.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import ClassVar, TypeVar

from ansible import constants as C  # noqa: N812 - its customary name
from ansible.errors import AnsibleError

from ...module_utils._common.documents import Arguments, Result, Variables
from ...module_utils._common.errors import FleetError
from .._kube.client import Kube
from .._model.context import Robot
from .._model.fleet import VARIABLE, Fleet, robot_from_vars
from .._model.outcomes import FAILED, UNCHANGED
from .._update.change import NOTHING, word_of
from .._update.cluster import KubeCluster, robots_on, run_name
from .._update.hands import Settings, World, look_seconds
from .._update.host import RobotSide
from .._update.host_change import HostChange
from .._update.ledger import Ledger
from .._update.outcome import WAITING, RobotOutcome, StepResult
from .._update.world import MonotonicClock
from . import voice
from .cluster import ClusterAction
from .host import RobotHost

Came = TypeVar("Came")


class GatedAction(ClusterAction):
    _requires_connection = True
    KIND: ClassVar[str]  # of the change, in the ledger

    def ledger(self, known: Variables, wave: str | None = None, kind: str = "") -> Ledger:
        """Hosts that come together are a wave, which the first of them names."""
        first = str((known.get("ansible_play_batch") or [known["inventory_hostname"]])[0])
        return Ledger(Path(C.DEFAULT_LOCAL_TMP), first if wave is None else wave, kind or self.KIND)

    def outcome(self, ledger: Ledger, budget: str, known: Variables, change: Callable[[], Came]) -> RobotOutcome | Came:
        """What the change came to. What goes wrong before it is the host's outcome, and no error of the run."""
        host = str(known["inventory_hostname"])
        hosts = known.get("ansible_play_hosts_all") or known.get("ansible_play_batch") or [host]
        begun = ledger.last(host).get("outcome") == WAITING  # whoever else of its wave has failed, and left, since
        try:
            refusal = "" if begun else ledger.refusal(budget, len(hosts))
            return RobotOutcome(UNCHANGED, refusal) if refusal else change()
        except (FleetError, AnsibleError) as error:  # of Ansible's: a variable of this host that cannot be templated
            return RobotOutcome(word_of(error), f"{NOTHING}: {error}")
        except Exception:  # a defect of ours counts as a failure of the host, and is seen as what it is
            ledger.note(host, FAILED)
            raise

    def run_of(self, kube: Kube, known: Variables) -> KubeCluster:
        """The cluster, as this run changes robots in it."""
        return KubeCluster(kube, self.say(known), run_name(known))

    def world(self, known: Variables, bring: Callable[[RobotHost, Sequence[str]], None] = lambda *_: None) -> World:
        """The task's host, its clock, and whoever listens to it."""
        there = RobotHost(self, known)

        def job(name: str, arguments: Arguments) -> Result:
            return there.job(f"ros_{name}", arguments)

        host = RobotSide(there.there, job, functools.partial(bring, there))
        stand = functools.partial(voice.stand, known["inventory_hostname"])
        return World(host, MonotonicClock(), self.say(known), stand)


class HostAction(GatedAction):
    """A change of the host itself."""

    since: float | None = None  # when the last one began to wait for the robots, by the clock's `now`

    def settings(self, variables: Variables, ready_timeout: float, name: str, before: Result) -> Settings:
        """How patient the change of this name is; `before` is what the ledger has of it."""
        since = before.get("since") if before.get("outcome") == WAITING else None
        return Settings(
            on_busy=variables["update_on_busy"],
            busy_timeout=variables["update_busy_timeout"],
            ready_timeout=ready_timeout,
            look_timeout=look_seconds(variables["update_busy_timeout"], since is not None),
            since={} if since is None else {name: since},
            check=bool(self._task.check_mode),
        )

    def robots(self, known: Variables, kube: Kube, node: str, edge: bool = True) -> list[Robot]:
        """The one whose host it is, or on an `edge` host those that have pods there."""
        if known["inventory_hostname"] in known[VARIABLE]["robots"]:
            return [robot_from_vars(known)]
        return robots_on(kube, node, Fleet.from_vars(known).robots.values()) if edge else []

    def taken(self, change: HostChange) -> StepResult:
        result = change.take()
        self.since = change.since
        return result
