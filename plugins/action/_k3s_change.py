# SPDX-License-Identifier: GPL-3.0-or-later
"""For the role k3s: exchange the k3s of a host that works, with the care that robots at work there need.

What is to come lies beside its place already. The result's `outcome` is a word of the fleet report.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, ClassVar

from ..module_utils._common.documents import Arguments, Result, Variables
from ..module_utils._common.errors import FleetError, NotReadyError, SpecError
from ..module_utils._host.k3s import BINARY, CONFIG_DIR
from ..module_utils._step.objects import name_of
from ..plugin_utils._action.cancelled import cancellable
from ..plugin_utils._action.gated import HostAction
from ..plugin_utils._action.host import RobotHost
from ..plugin_utils._action.servers import rotate_token
from ..plugin_utils._action.variables import OF_EVERY_CHANGE
from ..plugin_utils._k3s.plan import refusal, restarts_pods
from ..plugin_utils._k3s.rotation import lives, renewed, told
from ..plugin_utils._k3s.wanted import CERTIFICATES, FOR_AGENTS, TOKEN
from ..plugin_utils._model.outcomes import UNCHANGED, UPDATED
from ..plugin_utils._model.topology import EDGE_CLUSTER
from ..plugin_utils._report.held import nodes_off
from ..plugin_utils._report.kept import keep_early
from ..plugin_utils._update.change import StaysError
from ..plugin_utils._update.cluster import is_server
from ..plugin_utils._update.host_change import HostChange, Work
from ..plugin_utils._update.ledger import SERVERS
from ..plugin_utils._update.outcome import UNPROVEN, WAITING, RobotOutcome, StepResult

AIRGAP = "that of k3s_airgap_dir"  # its version is known when it is on the host


class K3sExchange(Work):
    """What the plan of the role says, by modules on the host."""

    name = "k3s"
    left = UNPROVEN

    note, stays = "", ""  # what of a rotation is told: where all went well, and where it did not

    def __init__(
        self, host: RobotHost, plan: Arguments, variables: Variables, rotate_token: Callable[[], None]
    ) -> None:
        self._rotate_token, self._exchanged = rotate_token, False
        self._host, self._plan, self._role = host, plan, variables["k3s_role"]
        self.node = variables["k3s_node_name"]
        self._timeout = variables["k3s_start_timeout"]
        # SQLite is one server's alone, also of one that others are to join
        self._start, self._alone, self._switched = "", not (plan["member"] and plan["etcd"]), False
        found = self._ask("staged")
        self.before = self.after = str(plan["version"])
        if plan["binary"]:  # check mode brings none
            release = variables["k3s_install_source"] == "release"
            self.after = str(found["staged"] or (variables["k3s_version"] if release else AIRGAP))
        self.unproven, self._earlier = bool(found["unproven"]), str(found["version"])
        self._renews = bool(plan["renews"])
        if self._renews:
            self.note = f"; certificates {told(lives(found['certificates']))}"
        if plan["rotate"] == TOKEN:
            self.note = "; another token of the servers"

    def refuse(self, servers: Sequence[str] = ()) -> None:
        """SpecError where that is no step to take; `servers` are the versions of those that it is an agent of."""
        back_to = self._earlier if self.unproven else ""
        if refused := refusal(self.before, self.after, servers, back_to, bool(self._plan["cgroup_refused"])):
            raise SpecError(refused)

    def make(self) -> None:
        if self._plan["rotate"] == TOKEN:
            self._rotate_token()
            self.stays = "; the servers' token is the new one"
        self._exchanged = True
        if self._plan["restart"]:  # else what nobody has proven runs already
            write = [*self._plan["write"], *([BINARY] if self._plan["binary"] else [])]
            write += [f"{CONFIG_DIR}/{name}" for name in self._plan["tokens"] if name == FOR_AGENTS]
            # the datastore was kept by the change that this one goes on from
            self._switched = not self.unproven
            renew = self._plan["rotate"] == CERTIFICATES
            self._ask("next", write=write, remove=self._plan["remove"], renew=renew)

    def works(self) -> None:
        asked = {"role": self._role, "member": self._plan["member"], "timeout": self._timeout}
        found = self._host.job("k3s_ready", asked)
        if found.get("failed"):
            raise NotReadyError(str(found.get("msg")))
        self._start = str(self._ask("staged")["start"])

    def undo(self) -> None:
        if not self._exchanged:
            raise StaysError("k3s was not started again; the next rotation of the token goes on")
        self._renews = False
        self._ask("previous", datastore=self._alone and self._switched)

    def proven(self) -> None:
        if self._renews:  # its kubelet was heard of by now, so that all of them are there
            self.note = f"; certificates {told(renewed(lives(self._ask('staged')['certificates'])))}"
        self._ask("proven", start=self._start)

    def _ask(self, state: str, **more: Any) -> Result:
        found = self._host.job("k3s_change", {"role": self._role, "state": state, **more})
        if found.get("failed"):
            raise FleetError(str(found.get("msg")))
        return found


class ActionModule(HostAction):
    """`plan` is what _k3s_plan found. Where the result has `waiting`, the robot works: the task is to come back."""

    TRANSFERS_FILES = True
    KIND = "k3s"
    ARGUMENTS: ClassVar = {"plan": {"type": "dict", "required": True}}

    def work(self, params: Arguments, known: Variables) -> Result:
        variables = self.variables(known, "k3s") | self.variables(known, "update", *OF_EVERY_CHANGE)
        # the shared cluster's servers come before everybody else's waves, and are none of theirs
        shared = (variables["k3s_role"], variables["k3s_cluster"]) == ("server", EDGE_CLUSTER)
        name, ledger = known["inventory_hostname"], self.ledger(known, kind=SERVERS if shared else "")
        before = ledger.last(name)
        budget = "0" if shared else variables["update_failure_budget"]
        with cancellable():
            outcome = self.outcome(ledger, budget, known, lambda: self._change(params, variables, known, before))
        word, reason = outcome.outcome, outcome.reason
        if word == UNCHANGED:
            if shared:  # they hold one datastore: what one did not take, none is given
                reason = "not begun: another server of its cluster failed"
            return {"changed": False, "outcome": RobotOutcome(UNCHANGED, reason).as_dict(), "msg": reason}
        ledger.note(name, word, since=self.since)
        if word == WAITING:
            return {"changed": False, "waiting": True, "msg": reason}
        if word != UPDATED:
            return {"changed": False, "failed": True, "outcome": outcome.as_dict(), "msg": f"{word}: {reason}"}
        told = f"would change: {reason}" if self._task.check_mode else reason
        return {"changed": True, "outcome": replace(outcome, reason=told).as_dict(), "msg": told}

    def _change(self, params: Arguments, variables: Variables, known: Variables, before: Result) -> RobotOutcome:
        plan = params["plan"]
        rotate = functools.partial(rotate_token, self, known, variables["k3s_server_hosts"])
        exchange = K3sExchange(RobotHost(self, known, bool(self._task.check_mode)), plan, variables, rotate)
        settings = self.settings(variables, variables["k3s_start_timeout"], exchange.name, before)
        if not plan["works"]:
            self.say(known)("k3s does not serve here, so no robot can be asked whether it is at work")
            exchange.refuse()
            return _told(self.taken(HostChange(exchange, settings, self.world(known))), exchange)
        with self.cluster(params, known) as kube:
            pods_notice = _permitted(exchange, kube.objects("Node"), variables)
            if pods_notice:
                self.say(known)(
                    f"k3s {exchange.before} -> {exchange.after}: the kubelet of another minor version may start all "
                    "containers of this node again"
                )
            robots = self.robots(known, kube, exchange.node, pods_notice)
            change = HostChange(exchange, settings, self.world(known), self.run_of(kube, known), robots)
            outcome = _told(self.taken(change), exchange)
            if not (self._task.check_mode or outcome.outcome == WAITING):
                changed = outcome.outcome == UPDATED
                keep_early(kube, known["inventory_hostname"], outcome.outcome, f"k3s: {outcome.reason}", changed)
            return outcome


def _told(found: StepResult, exchange: K3sExchange) -> RobotOutcome:
    reason = found.told() + exchange.note if found.outcome == UPDATED else found.reason + exchange.stays
    return RobotOutcome(found.outcome, reason, (found,))


def _permitted(exchange: K3sExchange, nodes: Sequence[dict[str, Any]], variables: Variables) -> bool:
    """Whether pods may notice it. SpecError where this step is not to be taken."""
    agent, servers = variables["k3s_role"] == "agent", [one for one in nodes if is_server(one)]
    exchange.refuse([one["status"]["nodeInfo"]["kubeletVersion"] for one in servers] if agent else ())
    others = (one for one in servers if name_of(one) != exchange.node)
    down = [] if agent else sorted(nodes_off(others))
    if down:  # with one more away the cluster may have no majority
        raise SpecError(
            f"{', '.join(down)} of its cluster is not Ready, and with one more server away the cluster may have no "
            f"majority. Bring {', '.join(down)} back first"
        )
    return restarts_pods(exchange.before, exchange.after)
