# SPDX-License-Identifier: GPL-3.0-or-later
"""For the role k3s: look at the host, refuse what cannot be mended, and say all that is to be done there.

The result holds no secret: the actions that write files and tokens work those out for themselves.
"""

from __future__ import annotations

from dataclasses import asdict, replace
from typing import ClassVar

from ..module_utils._common.documents import Arguments, Result, Variables
from ..module_utils._common.errors import SpecError
from ..module_utils._common.poll import PASS
from ..module_utils._host.k3s import ENCRYPTION, SERVICES
from ..module_utils._host.k3s_change import DATABASE, NEXT
from ..plugin_utils._action.base import FleetAction
from ..plugin_utils._action.host import ActionHost
from ..plugin_utils._action.servers import shared_token
from ..plugin_utils._action.variables import OF_EVERY_CHANGE
from ..plugin_utils._k3s.plan import BEHIND, old_archives, plan, refusals, unheard_refusal
from ..plugin_utils._k3s.wanted import API_PORT, CERTIFICATES, TOKEN, Datastore, Wanted, join_url, source, wanted
from ..plugin_utils._kube.kubeconfig import first_line, is_foreign, kubeconfig_head
from ..plugin_utils._model.topology import address
from ..plugin_utils._upstream import ansible_core

EXTERNAL = "datastore-endpoint"
# on a server that is still to come, as in check mode, it will be so
ENCRYPTS = f"if test ! -e {DATABASE} || test -e {ENCRYPTION}; then echo yes; else echo no; fi"


class ActionModule(FleetAction):
    """`rotate` is what of k3s is to be made anew, or nothing."""

    ARGUMENTS: ClassVar = {"rotate": {"type": "str", "choices": ["", CERTIFICATES, TOKEN], "default": ""}}

    def work(self, params: Arguments, known: Variables) -> Result:
        variables = self.variables(known, "k3s") | self.variables(known, "update", *OF_EVERY_CHANGE)
        part = wanted(variables, known["inventory_hostname"], known["hostvars"])
        host = ActionHost(self, known)
        servers = [] if part.init else [*_others(variables, known).values()]
        files = [*part.started_with, *(file.path for file in part.files if file.path not in part.started_with)]
        beside = [file.path for file in part.beside]
        asked = {"role": variables["k3s_role"], "files": files, "beside": beside, "servers": servers}
        asked["external"] = EXTERNAL in variables["k3s_config"]
        # an agent has one of its own, which the inventory does not know
        for_agents = variables["k3s_agent_token"] if variables["k3s_role"] == "server" else ""
        tokens = {"token": variables["k3s_token"], "agent_token": for_agents}
        now = host.job("k3s_facts", asked, tokens)
        if now.get("failed") or now.get("unreachable"):
            return now
        joins = "" if part.init else join_url(variables, known["hostvars"], now)
        datastore = Datastore(now["etcd"], self._encrypts(now, part, variables, known))
        part = wanted(variables, known["inventory_hostname"], known["hostvars"], joins, datastore)
        now["tokens"], part = self._rotation(params["rotate"], now, part, variables, known)
        found = _plan(now, part, variables, known)
        if found["unsure"]:
            self.say(known)("k3s is up and does not serve just now; that is waited for before anything is changed")
            seen = host.job("k3s_ready", {"role": variables["k3s_role"], "timeout": variables["k3s_start_timeout"]})
            if seen.get("unreachable") or "verdict" not in seen:
                return seen
            if refusal := unheard_refusal(seen, found, variables):
                raise SpecError(f"{known['inventory_hostname']} was left as it is. {refusal}")
            if seen["verdict"] == PASS:
                found = _plan({**now, "ready": True}, part, variables, known)
        if found["rotate"] and not (found["works"] or found["unproven"]):
            raise SpecError(
                f"{known['inventory_hostname']} was left as it is. No k3s serves here whose {found['rotate']} could be "
                "rotated; rosops.fleet.site brings one."
            )
        if found["any"] and (found["down"] or found["unsure"]):
            self.say(known)(
                "k3s does not serve here, and there is a cluster's data: whatever works here cannot be asked, and k3s "
                "is started with what the inventory says"
            )
        return {"changed": False, **asdict(datastore), **found, "renews": params["rotate"] == CERTIFICATES}

    def _rotation(
        self, rotate: str, now: Result, part: Wanted, variables: Variables, known: Variables
    ) -> tuple[Result, Wanted]:
        """Verdicts on the tokens, and the host's part with what is due; SpecError, KubeError.

        One that was cut off is gone on with. That of certificates is only to be proven where k3s serves with new ones.
        """
        servers, host = variables["k3s_server_hosts"], known["inventory_hostname"]
        agent, change = variables["k3s_role"] == "agent", now["change"]
        if rotate == CERTIFICATES and not (change["renewed"] and now["ready"]):
            return now["tokens"], replace(part, rotate=rotate, anew=part.anew or agent)
        if rotate != TOKEN or agent:
            return now["tokens"], part
        if variables["k3s_token"]:
            raise SpecError("k3s itself makes the new token. Take k3s_token out of the inventory; servers keep theirs.")
        shared = shared_token(self, known, servers)
        verdicts = {**now["tokens"], "server": "same" if shared.kept[host] == shared.newest else BEHIND}
        # the first server has it made at its turn; then the others are behind, which check mode does not see
        if not (part.init or self._task.check_mode) or not shared.agreed or change["unproven"]:
            return verdicts, part
        if away := sorted({*servers} - {*known["ansible_play_hosts_all"]}):
            raise SpecError(f"All servers of a cluster get the new token in one run. {', '.join(away)} is not in it.")
        return verdicts, replace(part, rotate=rotate)

    def _encrypts(self, now: Result, part: Wanted, variables: Variables, known: Variables) -> bool:
        """Whether k3s is to encrypt Secrets: a new cluster does, an old one as it did, on all its servers."""
        # whether an external datastore is new nobody knows here
        if now["data"] or variables["k3s_role"] == "agent" or EXTERNAL in variables["k3s_config"]:
            return bool(now["encrypts"])
        if part.init:
            return True
        look = {"ansible.builtin.command": {"argv": ["sh", "-c", ENCRYPTS]}, "become": True, "check_mode": False}
        for server in _givers(now, variables, known):
            if said := ansible_core.run_task(self, known, {**look, "delegate_to": server}).get("stdout"):
                return bool(said == "yes")
        return False  # it joins none of them either, then


def _others(variables: Variables, known: Variables) -> dict[str, str]:
    """The cluster's servers but the host itself, with their addresses: nobody joins himself."""
    servers = (server for server in variables["k3s_server_hosts"] if server != known["inventory_hostname"])
    return {server: f"{address(server, known['hostvars'])}:{API_PORT}" for server in servers}


def _givers(now: Result, variables: Variables, known: Variables) -> list[str]:
    """Servers that a new member may ask: those that answer, else the first one."""
    others = _others(variables, known)
    return [server for server, place in others.items() if place in now["answering"]] or [*others][:1]


def _plan(now: Result, part: Wanted, variables: Variables, known: Variables) -> Result:
    host = known["inventory_hostname"]
    if refused := list(refusals(now, variables, host)):
        raise SpecError(f"{host} was left as it is. {' '.join(refused)}")
    origin, servers = source(variables, now["machine"]), variables["k3s_server_hosts"]
    head = kubeconfig_head(now["kubeconfig_sha256"], part.url, variables["k3s_cluster"])
    right = first_line(part.kubeconfig) == head or is_foreign(part.kubeconfig)
    work = plan(now, part, origin, variables["k3s_version"], right)
    behind = now["tokens"]["server"] == BEHIND
    return {
        **work,
        "source": asdict(origin),
        "old_archives": old_archives(now, origin),
        "service": SERVICES[variables["k3s_role"]],
        "installed": now["service"]["installed"],
        # a first server without a datastore would start a second cluster where one of these has one
        "rivals": servers[1:] if part.init and not now["data"] else [],
        "join": work["tokens"] if variables["k3s_role"] == "server" and (behind or not part.init) else [],
        "joins": part.url,
        "cgroup_refused": now["cgroup_refused"],
        "givers": servers[:1] if behind else _givers(now, variables, known),
        "version": now["version"],
        "staged": NEXT if work["guarded"] else "",
        "hands_out": list(part.tokens),
        # waited for until etcd counts it; a cluster's only server has nobody to be counted by
        "member": variables["k3s_node_name"] if variables["k3s_role"] == "server" and len(servers) > 1 else "",
        "has_kubeconfig": bool(now["kubeconfig_sha256"]),
    }
