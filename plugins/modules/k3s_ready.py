#!/usr/bin/python
# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Wait until k3s on this host serves, or say why it does not."""

from __future__ import annotations

DOCUMENTATION = r"""
module: k3s_ready
short_description: Wait until k3s on a host serves
version_added: 1.0.0
description:
  - Waits until the unit is up and, on a server, its API says that it is ready and etcd has given it a vote.
  - Ends at once when waiting cannot help, as with a unit that keeps ending.
  - A failure carries the last observation and the end of the unit's journal, without tokens and passwords.
  - Changes nothing.
author:
  - rosops.fleet contributors (@rosops)
options:
  role:
    description: Which of the units to wait for.
    type: str
    choices: [server, agent]
    required: true
  member:
    description:
      - The Node's name of a server that shares its datastore with others. Its vote in etcd is waited for.
    type: str
    default: ""
  timeout:
    description: Seconds to wait.
    type: float
    default: 180
  interval:
    description: Seconds from one look to the next.
    type: float
    default: 0.5
  journal_lines:
    description: Lines of the unit's journal in the message of a failure.
    type: int
    default: 15
extends_documentation_fragment:
  - rosops.fleet._attributes.read_only
"""

EXAMPLES = r"""
- name: Wait for the server
  rosops.fleet.k3s_ready:
    role: server
    timeout: 120
"""

RETURN = r"""
observed:
  description: What was seen last.
  returned: always
  type: str
verdict:
  description: V(pass), V(wait) where the time was over, V(fail) where waiting cannot help.
  returned: always
  type: str
elapsed:
  description: Seconds that the wait took.
  returned: always
  type: float
"""

import time

from ansible.module_utils.basic import AnsibleModule

from ..module_utils._common.poll import PASS, poll
from ..module_utils._host.k3s import SERVICES, K3sHost

ARGUMENTS = {
    "role": {"type": "str", "choices": ["server", "agent"], "required": True},
    "member": {"type": "str", "default": ""},
    "timeout": {"type": "float", "default": 180},
    "interval": {"type": "float", "default": 0.5},
    "journal_lines": {"type": "int", "default": 15},
}


def main() -> None:
    module = AnsibleModule(argument_spec=ARGUMENTS, supports_check_mode=True)
    params = module.params
    host = K3sHost(module.run_command)
    service = SERVICES[params["role"]]
    began = time.time() - 5  # the start was asked for just before
    restarts = int(host.show(service).get("NRestarts") or 0)
    polled = poll(lambda: host.look(params["role"], params["member"], restarts), params["timeout"], params["interval"])
    result = {"verdict": polled.verdict, "observed": str(polled.last), "elapsed": round(polled.elapsed, 2)}
    if polled.verdict == PASS:
        module.exit_json(changed=False, **result)
    how = f"not ready after {params['timeout']:g} s" if polled.timed_out else "will not become ready"
    journal = host.journal(service, params["journal_lines"], began)
    module.fail_json(
        msg=f"{service} {how}: {polled.last}\nThe end of its journal (journalctl -u {service}):\n{journal}", **result
    )


if __name__ == "__main__":
    main()
