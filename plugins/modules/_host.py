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
      - V(facts) reads what decides whether k3s can run on the host, for the role P(rosops.fleet.preflight#role).
      - V(k3s_change) exchanges the host's k3s and keeps the one before, for the role P(rosops.fleet.k3s#role).
    type: str
    choices: [facts, k3s_change]
    required: true
  arguments:
    description: What the job takes.
    type: dict
    required: true
author:
  - rosops.fleet contributors (@rosops)
"""

EXAMPLES = r"""
# None, it is private.
"""

import time
from typing import Any, Mapping

from ansible.module_utils.basic import AnsibleModule

from ..module_utils._common.errors import FleetError
from ..module_utils._host.facts import Facts, collect
from ..module_utils._host.k3s import BINARY, Host
from ..module_utils._host.k3s_change import NEXT, K3sChange

Arguments = Mapping[str, Any]  # a job's, from the collection's own action


def facts(_module: AnsibleModule, arguments: Arguments) -> Facts:
    """`arguments` are `ports` ({port, protocol} each), `reach` (host:port each), and `timeout` in seconds."""
    began, ports = time.time(), [(port["protocol"], port["port"]) for port in arguments["ports"]]
    found = collect(Host(), ports, arguments["reach"], arguments["timeout"])
    # Both readings, for the action: the time in between is the module's own work, no part of the way.
    return {"changed": False, "facts": {**found, "clock": {"began": began, "ended": time.time()}}}


def k3s_change(module: AnsibleModule, arguments: Arguments) -> Facts:
    """`arguments` are the `role` and the `state`.

    With the state `staged` nothing is changed. `next` exchanges what is in `write` and `remove`, `previous` takes an
    unproven change back, the `datastore`, too, if so, and `proven` says that the `start` of the unit was a good one.
    """
    change, state = K3sChange(module.run_command, arguments["role"]), arguments["state"]
    record = change.record()
    changed = state in ("next", "previous") or (state == "proven" and record.unproven)
    if not module.check_mode:
        if state == "next":
            record = change.switch(arguments["write"], arguments["remove"])
        elif state == "previous":
            record = change.back(arguments["datastore"])
        elif state == "proven":
            change.prove(arguments["start"])
            record = change.record()
    return {
        "changed": changed,
        "staged": change.version(BINARY + NEXT),
        "version": record.version,
        "unproven": record.unproven,
        "start": change.invocation(),
    }


JOBS = {"facts": facts, "k3s_change": k3s_change}


def main() -> None:
    module = AnsibleModule(
        argument_spec={
            "job": {"type": "str", "choices": list(JOBS), "required": True},
            "arguments": {"type": "dict", "required": True},
        },
        supports_check_mode=True,
    )
    job, arguments = module.params["job"], module.params["arguments"]
    try:
        result = JOBS[job](module, arguments)
    except (FleetError, OSError) as error:
        module.fail_json(msg=f"{job}: {error}")
    module.exit_json(**result)


if __name__ == "__main__":
    main()
