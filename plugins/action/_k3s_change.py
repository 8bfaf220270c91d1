# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""For the role k3s: exchange the k3s of a host that works, with the care that robots at work there need.

What is to come lies beside its place already. The result's `outcome` is a word of the fleet report.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar

from ansible import constants as C  # noqa: N812 - its customary name
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import FleetError, NotReadyError, SpecError
from ansible_collections.rosops.fleet.plugins.module_utils._host.k3s import BINARY
from ansible_collections.rosops.fleet.plugins.plugin_utils._action.cancelled import cancellable
from ansible_collections.rosops.fleet.plugins.plugin_utils._action.cluster import ClusterAction
from ansible_collections.rosops.fleet.plugins.plugin_utils._action.guarding import Guarding
from ansible_collections.rosops.fleet.plugins.plugin_utils._action.robot_host import RobotHost
from ansible_collections.rosops.fleet.plugins.plugin_utils._action.variables import (
    change_variables,
    plain,
    role_variables,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._k3s.upgrade import refusal, restarts_pods
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.access import ServersAwayError
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.outcomes import FAILED, OFFLINE, UNCHANGED, UPDATED
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.topology import EDGE_CLUSTER
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.keep import keep_early
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.change import Limits
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.cluster import run_name
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.kube_nodes import (
    KubeNodes,
    server_versions,
    servers_down,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.ledger import Ledger
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.outcome import UNPROVEN, WAITING, StepResult
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.rest import look_seconds
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.world import AwayError

AIRGAP = "that of k3s_airgap_dir"  # its version is known when it is on the host
LEDGER, SERVERS_LEDGER = "rosops-fleet-k3s.jsonl", "rosops-fleet-k3s-servers.jsonl"


class K3sExchange:
    """The change, as `Guarded` wants it: what the plan of the role says, by modules on the host."""

    name = "k3s"
    left = UNPROVEN

    def __init__(self, host: RobotHost, plan: Mapping[str, Any], variables: Mapping[str, Any]) -> None:
        self._host, self._plan, self._role = host, plan, variables["k3s_role"]
        self._timeout = variables["k3s_start_timeout"]
        release = variables["k3s_install_source"] == "release"
        self.before = self.after = str(plan["version"])
        self._coming = str(variables["k3s_version"] if release else AIRGAP) if plan["binary"] else ""
        self.unproven, self.earlier = False, ""
        # SQLite is one server's alone, also of one that others are to join
        self.cgroup_refused = bool(plan["cgroup_refused"])
        self._start, self._alone, self._switched = "", not (plan["member"] and plan["etcd"]), False

    def look(self) -> None:
        """What is staged, and whether anybody has proven what is there."""
        found = self._ask("staged")
        # check mode brings no binary
        coming = str(found["staged"]) if self._plan["binary"] else ""
        self.after = coming or self._coming or self.before
        self.unproven, self.earlier = bool(found["unproven"]), str(found["version"])

    def make(self) -> None:
        if self._plan["restart"]:  # else what nobody has proven runs already
            write = [*self._plan["write"], *([BINARY] if self._plan["binary"] else [])]
            # the datastore was kept by the change that this one goes on from
            self._switched = not self.unproven
            self._ask("next", write=write, remove=self._plan["remove"])

    def works(self) -> None:
        asked = {"role": self._role, "member": self._plan["member"], "timeout": self._timeout}
        found = self._host.module("rosops.fleet.k3s_ready", asked)
        if found.get("failed"):
            raise NotReadyError(str(found.get("msg")))
        self._start = str(self._ask("staged")["start"])

    def undo(self) -> None:
        self._ask("previous", datastore=self._alone and self._switched)

    def proven(self) -> None:
        self._ask("proven", start=self._start)

    def _ask(self, state: str, **more: Any) -> dict[str, Any]:
        found = self._host.job("k3s_change", {"role": self._role, "state": state, **more})
        if found.get("failed"):
            raise FleetError(str(found.get("msg")))
        return found


class ActionModule(ClusterAction):
    """`plan` is what _k3s_plan found.

    Where the result has `waiting`, the robot works: the task is to come back, and say so in `since`.
    """

    TRANSFERS_FILES = True
    _requires_connection = True
    ARGUMENTS: ClassVar = {"plan": {"type": "dict", "required": True}, "since": {"type": "float"}}

    def work(self, params: Mapping[str, Any], known: dict[str, Any]) -> dict[str, Any]:
        name = known["inventory_hostname"]
        variables = role_variables("k3s", self._templar, known) | change_variables(self._templar, known)
        batch = known.get("ansible_play_batch") or [name]
        # the shared cluster's servers come before everybody else's waves, and are none of theirs
        shared = (variables["k3s_role"], variables["k3s_cluster"]) == ("server", EDGE_CLUSTER)
        ledger = Ledger(Path(C.DEFAULT_LOCAL_TMP), str(batch[0]), SERVERS_LEDGER if shared else LEDGER)
        hosts = len(known.get("ansible_play_hosts_all") or batch)
        try:
            refusal = ledger.refusal("0" if shared else variables["update_failure_budget"], hosts)
            if refusal:
                if shared:  # they hold one datastore: what one did not take, none is given
                    refusal = "not begun: another server of its cluster failed"
                return {"changed": False, "outcome": _outcome(UNCHANGED, refusal, None), "msg": refusal}
            with cancellable():
                found, since = self._change(params, variables, known)
        except (AwayError, ServersAwayError) as error:
            return _failure(OFFLINE, f"nothing was touched: {error}")
        except FleetError as error:
            ledger.note(name, FAILED)
            return _failure(FAILED, f"nothing was touched: {error}")
        if found.outcome == WAITING:
            return {"changed": False, "waiting": since, "msg": found.reason}
        ledger.note(name, found.outcome)
        if found.outcome != UPDATED:
            return _failure(found.outcome, found.reason, found)
        told = f"would change: {found.told()}" if self._task.check_mode else found.told()
        return {"changed": True, "outcome": _outcome(UPDATED, told, found), "msg": told}

    def _change(
        self, params: Mapping[str, Any], variables: Mapping[str, Any], known: dict[str, Any]
    ) -> tuple[StepResult, float | None]:
        """What became of it; and since when it has waited, where it is `waiting`."""
        plan = plain(params["plan"])
        exchange = K3sExchange(RobotHost(self, known), plan, variables)
        exchange.look()
        node, limits = variables["k3s_node_name"], self._limits(variables, params["since"])
        if not plan["works"]:
            self.say(known)("k3s does not serve here, so no robot can be asked whether it is at work")
            _step(exchange, ())
            return Guarding(self, known, None).change(exchange, (), node, limits).run(), None
        with self.cluster(params, known) as kube:
            cluster = KubeNodes(kube, self.say(known), run_name(known))
            pods_notice = _permitted(exchange, cluster.nodes(), variables)
            if pods_notice:
                self.say(known)(
                    f"k3s {exchange.before} -> {exchange.after}: the kubelet of another minor version may start all "
                    "containers of this node again"
                )
            guarding = Guarding(self, known, cluster)
            guarded = guarding.change(exchange, guarding.robots(node, pods_notice), node, limits)
            found = guarded.run()
            if not (self._task.check_mode or found.outcome == WAITING):
                told = found.told() if found.outcome == UPDATED else found.reason
                keep_early(kube, known["inventory_hostname"], found.outcome, f"k3s: {told}", found.outcome == UPDATED)
            return found, guarded.since

    def _limits(self, variables: Mapping[str, Any], since: float | None) -> Limits:
        return Limits(
            on_busy=variables["update_on_busy"],
            busy_timeout=variables["update_busy_timeout"],
            ready_timeout=variables["k3s_start_timeout"],
            look=look_seconds(variables["update_busy_timeout"], since is not None),
            since=since,
            check=bool(self._task.check_mode),
        )


def _permitted(exchange: K3sExchange, nodes: Sequence[dict[str, Any]], variables: Mapping[str, Any]) -> bool:
    """Whether pods may notice it. SpecError where this step is not to be taken."""
    agent, node = variables["k3s_role"] == "agent", variables["k3s_node_name"]
    _step(exchange, tuple(server_versions(nodes).values()) if agent else ())
    down = [] if agent else servers_down(nodes, node)
    if down:
        raise SpecError(
            f"{', '.join(down)} of its cluster is not Ready, and with one more server away the cluster may have no "
            f"majority. Bring {', '.join(down)} back first"
        )
    return restarts_pods(exchange.before, exchange.after)


def _step(exchange: K3sExchange, servers: Sequence[str]) -> None:
    """SpecError where that is no step to take."""
    back_to = exchange.earlier if exchange.unproven else ""
    if refused := refusal(exchange.before, exchange.after, servers, back_to, exchange.cgroup_refused):
        raise SpecError(refused)


def _failure(word: str, reason: str, found: StepResult | None = None) -> dict[str, Any]:
    return {"changed": False, "failed": True, "outcome": _outcome(word, reason, found), "msg": f"{word}: {reason}"}


def _outcome(word: str, reason: str, found: StepResult | None) -> dict[str, Any]:
    return {"outcome": word, "reason": reason, "steps": [found.as_dict()] if found else []}
