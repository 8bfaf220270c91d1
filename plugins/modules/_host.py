#!/usr/bin/python
# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Private: the host's side of actions that are private, too. They have checked the arguments."""

from __future__ import annotations

DOCUMENTATION = r"""
module: _host
short_description: Private, what the collection's own actions have done on a host
version_added: 1.0.0
description:
  - For the collection's own actions alone. Its options and results change with any release.
options:
  job:
    description:
      - What is to be done; each job's function in the code says more. V(facts) is for P(rosops.fleet.preflight#role),
        what begins with C(k3s) for P(rosops.fleet.k3s#role), what begins with C(ros) for updates.
    type: str
    choices: [facts, k3s_facts, k3s_ready, k3s_download, k3s_change, k3s_remove,
              ros_graph, ros_ready, ros_hold, ros_release, ros_register, ros_reap, ros_watch]
    required: true
  arguments: {description: What the job takes., type: dict, required: true}
  secrets: {description: 'More of that, which no log gets.', type: dict, default: {}}
author:
  - rosops.fleet contributors (@rosops)
"""

EXAMPLES = r"""
# None, it is private.
"""

import os
import time
from http.client import HTTPException
from pathlib import Path

from ansible.module_utils.basic import AnsibleModule
from ansible.module_utils.urls import open_url

from ..module_utils._common.documents import Arguments
from ..module_utils._common.errors import FleetError, NotReadyError
from ..module_utils._common.poll import PASS, poll
from ..module_utils._host import k3s
from ..module_utils._host.facts import Facts, collect, k3s_facts
from ..module_utils._host.k3s_change import NEXT, K3sChange
from ..module_utils._host.k3s_remove import Remover
from ..module_utils._ros import jobs, traffic

LOOKS = 0.5  # seconds from one look to the next
JOURNAL_LINES = 15
ANSWER = 60.0  # seconds that a download's server has for it


def facts(_module: AnsibleModule, arguments: Arguments) -> Facts:
    """What decides whether k3s can run on the host.

    `arguments` are `ports` ({port, protocol} each), `reach` (host:port each), and `timeout` in seconds.
    """
    began, ports = time.time(), [(port["protocol"], port["port"]) for port in arguments["ports"]]
    found = collect(k3s.Host(), ports, arguments["reach"], arguments["timeout"])
    # Both readings, for the action: the time in between is the module's own work, no part of the way.
    return {"changed": False, "facts": {**found, "clock": {"began": began, "ended": time.time()}}}


def look(module: AnsibleModule, arguments: Arguments) -> Facts:
    """See `k3s_facts`. Tokens are compared on the host and never returned."""
    return {"changed": False, **k3s_facts(k3s.K3sHost(module.run_command), arguments)}


def k3s_ready(module: AnsibleModule, arguments: Arguments) -> Facts:
    """Wait `timeout` seconds until the unit of the `role` is up and, on a server, its API says that it is ready.

    `member` is the Node's name of a server that shares its datastore with others: its vote in etcd is waited for, too.
    NotReadyError has the last observation and the end of the unit's journal, without tokens and passwords.
    """
    host, role, timeout = k3s.K3sHost(module.run_command), arguments["role"], arguments["timeout"]
    service = k3s.SERVICES[role]
    began = time.time() - 5  # the start was asked for just before
    restarts = int(host.show(service).get("NRestarts") or 0)
    polled = poll(lambda: host.look(role, arguments.get("member", ""), restarts), timeout, LOOKS)
    found = {"verdict": polled.verdict, "observed": str(polled.last), "elapsed": round(polled.elapsed, 2)}
    if polled.verdict == PASS:
        return {"changed": False, **found}
    how = f"not ready after {timeout:g} s" if polled.timed_out else "will not become ready"
    journal = host.journal(service, JOURNAL_LINES, began)
    told = f"{service} {how}: {polled.last}\nThe end of its journal (journalctl -u {service}):\n{journal}"
    raise NotReadyError(told, **found)


def k3s_download(module: AnsibleModule, arguments: Arguments) -> Facts:
    """`arguments` are the `url`, where it goes (`dest`), its `sha256`, and where that is empty `sums`, the address of a
    list as sha256sum writes it. The `environment` is that of k3s's unit: what it says of proxies counts.
    """
    url, place, expected = arguments["url"], Path(arguments["dest"]), arguments["sha256"]
    if module.check_mode:
        return {"changed": not expected or k3s.sha256(place) != expected}
    os.environ.update(k3s.proxies(arguments["environment"]))
    try:
        if not expected:
            sums = open_url(arguments["sums"], timeout=ANSWER).read().decode()
            expected = k3s.listed_sum(sums, url.rpartition("/")[2], arguments["sums"])
        return {"changed": k3s.fetch(lambda at: open_url(at, timeout=ANSWER), url, place, expected)}
    except (FleetError, OSError, HTTPException, ValueError) as error:
        raise FleetError(k3s.without_secrets(f"{url} could not be downloaded: {error}")) from error


def k3s_change(module: AnsibleModule, arguments: Arguments) -> Facts:
    """`arguments` are the `role` and the `state`.

    With the state `staged` nothing is changed. `next` exchanges what is in `write` and `remove`, and has the
    certificates made anew if it is to `renew`; `previous` takes an unproven change back, the `datastore`, too, if so,
    and `proven` says that the `start` of the unit was a good one.
    """
    change, state = K3sChange(module.run_command, arguments["role"]), arguments["state"]
    record = change.record()
    changed = state in ("next", "previous") or (state == "proven" and record.unproven)
    if not module.check_mode:
        if state == "next":
            record = change.switch(arguments["write"], arguments["remove"], arguments["renew"])
        elif state == "previous":
            record = change.back(arguments["datastore"])
        elif state == "proven":
            change.prove(arguments["start"])
            record = change.record()
    return {
        "changed": changed,
        # in check mode it is what a run before has left, and may be another one than what comes
        "staged": "" if module.check_mode else change.version(k3s.BINARY + NEXT),
        "version": record.version,
        "unproven": record.unproven,
        "start": change.invocation(),
        "certificates": change.ends(),
    }


def k3s_remove(module: AnsibleModule, arguments: Arguments) -> Facts:
    """With `volumes` and `identity` the data of persistent volumes goes, too, and the node's password: a cluster that
    goes on without this node knows it by that. `removed`: what went, or would go in check mode, each kind a list.
    """
    remover = Remover(module.run_command, module.get_bin_path, dry=module.check_mode)
    try:
        removed = remover.everything(arguments["volumes"], arguments["identity"])
    except (FleetError, OSError) as error:
        told = f"k3s is not wholly removed: {error}. Running this again goes on where it ended."
        raise FleetError(told) from error
    return {"changed": any(removed.values()), "removed": removed}


JOBS = {
    "facts": facts,
    "k3s_facts": look,
    "k3s_ready": k3s_ready,
    "k3s_download": k3s_download,
    "k3s_change": k3s_change,
    "k3s_remove": k3s_remove,
}
ROS_JOBS = {  # which need nothing of the module; in check mode the engine has none of them done that changes something
    **{f"ros_{name}": job for name, job in jobs.JOBS.items()},
    "ros_watch": traffic.watch,
}


def main() -> None:
    module = AnsibleModule(
        argument_spec={
            "job": {"type": "str", "choices": [*JOBS, *ROS_JOBS], "required": True},
            "arguments": {"type": "dict", "required": True},
            "secrets": {"type": "dict", "default": {}, "no_log": True},
        },
        supports_check_mode=True,
    )
    job, arguments = module.params["job"], {**module.params["arguments"], **module.params["secrets"]}
    try:
        result = ROS_JOBS[job](arguments) if job in ROS_JOBS else JOBS[job](module, arguments)
    except FleetError as error:
        module.fail_json(msg=str(error), **error.details)
    except OSError as error:
        module.fail_json(msg=f"{job}: {error}")
    module.exit_json(**result)


if __name__ == "__main__":
    main()
