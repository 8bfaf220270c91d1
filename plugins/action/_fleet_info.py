# SPDX-License-Identifier: GPL-3.0-or-later
"""For playbooks that look: the hosts of the run, and what their clusters answer to one question.

With `access_only` a host of each cluster gets the access to it, side by side, before one task asks them all. Why there
is none is what that task says of the cluster.

`volumes` and `images` name the variables in which every host has the registered result of a task: what `du -sb` printed
of the directories of its volumes, and what `k3s crictl images -o json` did.

`graphs` of the result are the ROS graphs to read. With the option `graphs`, `read` is what keepers have read of them.
"""

from __future__ import annotations

import contextlib
import time
from dataclasses import replace
from functools import partial
from itertools import chain
from typing import ClassVar

from ..module_utils._common.documents import Arguments, Result, Variables
from ..module_utils._common.errors import FleetError
from ..plugin_utils._action.cluster import ClusterAction
from ..plugin_utils._images.archive import normal_ref
from ..plugin_utils._images.node import node_images
from ..plugin_utils._kube.running import Known, outdated
from ..plugin_utils._model.fleet import Fleet, Home
from ..plugin_utils._model.host_variables import HostVariables
from ..plugin_utils._model.keys import plain
from ..plugin_utils._report import look
from ..plugin_utils._report.held import cluster_rows, outdated_rows
from ..plugin_utils._upstream.ansible_core import BRIEF


class ActionModule(ClusterAction):
    ACCESS: ClassVar = {}  # none is that of all clusters
    ARGUMENTS: ClassVar = {
        "volumes": {"type": "str", "default": ""},
        "images": {"type": "str", "default": ""},
        "access_only": {"type": "bool", "default": False},
        "graphs": {"type": "bool", "default": False},
    }

    def work(self, params: Arguments, known: Variables) -> Result:
        fleet, hostvars = Fleet.from_vars(known), HostVariables(known["hostvars"])

        def way_to(host: str) -> tuple[Home, str, Variables, Arguments]:
            path = str(hostvars[host].get("k3s_kubeconfig_path") or "")
            return Home(fleet.hosts[host], fleet.name), path, known, {}

        if params["access_only"]:
            with contextlib.suppress(FleetError):
                self.way(*way_to(known["inventory_hostname"]))
            return {"changed": False}
        variables = {host: hostvars[host] for host in known["ansible_play_hosts_all"]}
        results = {host: own.get(params["volumes"], {}) for host, own in variables.items()}
        addresses = {host: str(own.get("ansible_host", host)) for host, own in variables.items()}
        hosts = look.members(fleet, addresses, results)
        asked, silent = look.clusters_of(hosts)

        now = time.time()
        # whoever looks wants to see it now, and can look again
        opened = {name: partial(self.opened, *way_to(host), patience=0) for name, host in asked.items()}
        answers = look.ask(opened)
        for name in answers.keys() & fleet.robots.keys():
            answers[name] = look.believed(answers[name], name, now)
        mute = {**silent, **{cluster: answer.problem for cluster, answer in answers.items() if answer.problem}}
        found = cluster_rows([one.objects for one in answers.values()], look.usage_of(results, fleet.robots), now)
        pods = chain(*(one.objects.get("Pod", ()) for one in answers.values()))
        services = {name: one.objects.get("Service", ()) for name, one in answers.items()}
        old = outdated_rows(outdated(pods, _known(fleet, variables, params["images"])))
        problems = (*look.cluster_problems(mute, hosts), *look.unmeasured(results), *old)
        status = replace(found, hosts=tuple(host.row for host in hosts), problems=problems)
        seen = look.Look(status, look.graphs_to_read(hosts, services, found.apps), fleet.name)
        read = look.read_by_keepers(seen.graphs, hosts, opened) if params["graphs"] else {}
        # -v has tables of it, not thousands of lines of JSON
        return {"changed": False, **plain(seen), "read": read, **BRIEF}


def _known(fleet: Fleet, variables: Variables, name: str) -> Known:
    """What images' names mean on the nodes that said it in the variable of this name."""
    said = {fleet.hosts[host].node: own.get(name, {}) for host, own in variables.items()}
    images = {}
    for node, one in said.items():
        with contextlib.suppress(FleetError):  # without a list nothing is said of its images
            images[node] = node_images(str(one.get("stdout"))) if one.get("rc") == 0 else {}

    def known(node: str, ref: str) -> set[str]:
        found = images.get(node, {}).get(normal_ref(ref))
        return {found} if found else set()

    return known
