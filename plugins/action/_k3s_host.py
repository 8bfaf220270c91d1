# SPDX-License-Identifier: GPL-3.0-or-later
"""For the role k3s: what it has done on the host beside the exchange, and the kubeconfig from there."""

from __future__ import annotations

import base64
import functools
import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar

from ..module_utils._common.documents import Arguments, Result, Variables
from ..module_utils._common.errors import FleetError, KubeError, SpecError
from ..module_utils._host.k3s import BINARY, CONFIG_DIR, KUBECONFIG
from ..plugin_utils._action.base import FleetAction
from ..plugin_utils._action.host import ActionHost
from ..plugin_utils._action.servers import on_server
from ..plugin_utils._action.variables import plain
from ..plugin_utils._k3s.wanted import FOR_AGENTS, Datastore, Wanted, enrolled, tokens_to_keep, wanted
from ..plugin_utils._kube.kubeconfig import first_line, is_foreign, keep, kubeconfig_head, local_kubeconfig
from ..plugin_utils._objects.revocation import described, policy_name, refusal_of

# as systemd does itself when the bridge appears
BRIDGE = ["/lib/systemd/systemd-sysctl", "--prefix=/net/ipv4/neigh/cni0"]
LASTS = "1h"  # a token for the join of one agent; one that did not get there in time gets another one


class ActionModule(FleetAction):
    """`plan` is what _k3s_plan found. `remove` needs none, and without one `ready` waits for no vote in etcd.

    `registered` names, for the `files`, the variable with what slurp read of the tokens on the first server, where it
    does not exist.
    """

    TRANSFERS_FILES = True
    ARGUMENTS: ClassVar = {
        "do": {"type": "str", "choices": ["files", "download", "ready", "kubeconfig", "remove"], "required": True},
        "plan": {"type": "dict", "default": {}},
        "registered": {"type": "str", "default": ""},
    }

    def work(self, params: Arguments, known: Variables) -> Result:
        check, plan, variables = bool(self._task.check_mode), params["plan"], self.variables(known, "k3s")
        host = ActionHost(self, known, check_mode=check)
        if params["do"] == "files":
            read = plain(self._templar.template(known.get(params["registered"], {}))).get("results", [])
            if variables["k3s_role"] == "server":
                tokens = tokens_to_keep(plan["tokens"], read, variables)
            else:
                tokens = {name: "" if check else self._token(plan, variables, known) for name in plan["tokens"]}
            return self._files(plan, tokens, variables, known)
        if params["do"] == "download":  # through the proxies that k3s itself goes through; a password in one is on no
            source = {name: plan["source"][name] for name in ("url", "sha256", "sums")}  # command line so
            asked = {**source, "dest": BINARY + plan["staged"]}
            return host.job("k3s_download", asked, {"environment": variables["k3s_environment"]})
        if params["do"] == "ready":
            asked = {"role": variables["k3s_role"], "timeout": variables["k3s_start_timeout"]}
            return host.job("k3s_ready", {**asked, "member": plan.get("member", "")})
        part = wanted(variables, known["inventory_hostname"], known["hostvars"])
        if params["do"] == "kubeconfig":
            return _fetched(ActionHost(self, known), part, variables["k3s_cluster"], plan["has_kubeconfig"], check)
        asked = {"volumes": variables["k3s_remove_volumes"], "identity": variables["k3s_remove_identity"]}
        found = host.job("k3s_remove", asked)
        # other servers may go on with the cluster
        if found.get("failed") or set(variables["k3s_server_hosts"]) - set(known["ansible_play_hosts_all"]):
            return found
        return {**found, **_forgotten(part, variables["k3s_cluster"], bool(found["changed"]), check)}

    def _token(self, plan: Arguments, variables: Variables, known: Variables) -> str:
        """A token for this host. A server of its cluster makes it (`k3s token create`), and it ends.

        An agent of k3s needs it for the join alone. When it starts again it shows its node's certificate, and gets new
        ones for that as long as the cluster has its Node: k3s-io/k3s, docs/adrs/agent-join-token.md, pull request 6663
        (since 1.26.2), pkg/nodepassword/validate.go.
        """
        host, node, problems = known["inventory_hostname"], variables["k3s_node_name"], []
        policies, policy = "validatingadmissionpolicybinding,validatingadmissionpolicy", policy_name(node)
        ask = functools.partial(on_server, self, known)
        for server in plan["givers"]:
            try:
                if ask(server, BINARY, "kubectl", "get", policies, policy, "--ignore-not-found", "-o", "name"):
                    if not enrolled(variables, host):
                        raise SpecError(f"{host} gets no token: {refusal_of(node)}")
                    ask(server, BINARY, "kubectl", "delete", policies, policy, "--ignore-not-found")
                return ask(server, BINARY, "token", "create", "--ttl", LASTS, "--description", described(node))
            except KubeError as error:
                problems.append(f"{server}: {error}")
        raise FleetError(
            f"{host} has not joined the cluster {variables['k3s_cluster']} yet. To join, it needs a token, which no "
            f"server of that could make (is one on, and k3s installed on it?): {'; '.join(problems)}"
        )

    def _files(self, plan: Arguments, tokens: Mapping[str, str], variables: Variables, known: Variables) -> Result:
        """Write the tokens, and write and delete the files that the plan names. What may hold passwords has no diff.

        What is `staged` (an ending) lies beside its place until somebody exchanges it, a token for agents, too; its
        place is looked at only, for the diff, and nothing is deleted.
        """
        check, staged = bool(self._task.check_mode), plan["staged"]
        host = ActionHost(self, known, check_mode=check)
        place = ActionHost(self, known, check_mode=check or bool(staged))
        there = (plan["joins"], Datastore(plan["etcd"], plan["encrypts"]))
        part = wanted(variables, known["inventory_hostname"], known["hostvars"], *there)
        result = {"changed": False, "diff": [], "written": plan["write"], "removed": plan["remove"]}
        done = []
        for name, text in tokens.items():
            beside = staged if name == FOR_AGENTS else ""  # a server that boots meanwhile needs the newest of its own
            done.append(host.write(f"{CONFIG_DIR}/{name}{beside}", f"{text}\n", "0600", diff=False))
        for file in (file for file in part.beside if file.path in plan["beside"]):
            done.append(host.write(file.path, file.content, file.mode, diff=self._task.diff))
        if plan["beside"] and not check:
            done.append(host.module("ansible.builtin.command", {"argv": BRIDGE}))
        for file in (file for file in part.files if file.path in plan["write"]):
            done.append(place.write(file.path, file.content, file.mode, diff=self._task.diff and not file.secret))
            if staged and not check:
                done.append(host.write(file.path + staged, file.content, file.mode, diff=False))
        done += [place.module("ansible.builtin.file", {"path": path, "state": "absent"}) for path in plan["remove"]]
        for one in done:
            if one.get("failed"):
                return {**result, "failed": True, "msg": one.get("msg", "a file could not be written")}
            diffs = one.get("diff") or []
            result["diff"] += diffs if isinstance(diffs, list) else [diffs]
            result["changed"] |= bool(one.get("changed"))
        return result


def _fetched(host: ActionHost, part: Wanted, cluster: str, there: bool, check: bool) -> Result:
    """The administrator's kubeconfig, of which nothing is shown; `there`: the server has one already."""
    if is_foreign(part.kubeconfig):
        return {"changed": False, "msg": f"{part.kubeconfig} was not written by this role and stays as it is"}
    if check and not there:
        return {"changed": True, "msg": f"{part.kubeconfig} would be written"}
    read = host.module("ansible.builtin.slurp", {"src": KUBECONFIG})
    if read.get("failed"):
        return {"failed": True, "msg": read.get("msg", f"{KUBECONFIG} cannot be read")}
    text = base64.b64decode(read["content"])
    digest = hashlib.sha256(text).hexdigest()
    config = local_kubeconfig(text.decode(errors="replace"), part.url, cluster, digest)
    return {"changed": keep(part.kubeconfig, config, check), "path": part.kubeconfig}


def _forgotten(part: Wanted, cluster: str, changed: bool, check: bool) -> Result:
    """Delete the one that was written for this cluster; another one's stays. `changed`: so was the host."""
    path = Path(part.kubeconfig)
    if not (part.kubeconfig and path.exists()):
        return {"changed": changed}
    if not first_line(part.kubeconfig).startswith(kubeconfig_head("", part.url, cluster)):
        return {"changed": changed, "msg": f"{path} was not written for the cluster {cluster} and stays as it is"}
    if not check:
        path.unlink()
    return {"changed": True, "path": part.kubeconfig}
