# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Exchange the k3s of a host, and keep the one before."""

from __future__ import annotations

DOCUMENTATION = r"""
module: k3s_change
short_description: Exchange the k3s of a host, and keep the one before
version_added: 1.0.0
description:
  - Puts what lies beside its place as C(<path>.next) there, keeps what was there as C(<path>.previous), and starts
    k3s again. On a server the datastore is kept first, by C(k3s etcd-snapshot), or as a copy of the database of a k3s
    that is stopped for it; where that fails nothing is exchanged.
  - As long as a change is not proven, what is kept is not written over, so that a change that was cut off or tried
    again goes back to what last worked.
  - The role P(rosops.fleet.k3s#role) stages the files, asks before, and proves the change afterwards.
  - Needs nothing but Python's standard library on the host.
author:
  - rosops.fleet contributors (@rosops)
options:
  role:
    description: What the host is.
    type: str
    choices: [server, agent]
    required: true
  state:
    description:
      - V(staged) says what version lies there to come, and changes nothing.
      - V(next) exchanges, V(previous) goes back from a change that is not proven, V(proven) says that it is.
    type: str
    choices: [staged, next, previous, proven]
    required: true
  write:
    description: Files whose C(.next) takes their place.
    type: list
    elements: path
    default: []
  remove:
    description: Files that are not to be there.
    type: list
    elements: path
    default: []
  datastore:
    description:
      - With V(previous), whether the datastore that was kept is put back, too, where the change was to another minor
        version. k3s does not go back to an earlier one without it. What the cluster was told since is lost.
      - For a server alone that shares its datastore with no other.
    type: bool
    default: false
  start:
    description:
      - With V(proven), the start of the unit that was proven, as RV(start) said it before. It fails if there was
        another one since.
    type: str
    default: ""
attributes:
  check_mode:
    description: Says whether it would change something.
    support: full
  diff_mode:
    description: The files are written, and shown, by those who stage them.
    support: none
"""

EXAMPLES = r"""
- name: Take the staged binary
  rosops.fleet.k3s_change:
    role: agent
    state: next
    write: [/usr/local/bin/k3s]
"""

RETURN = r"""
staged:
  description: Version of the staged binary; empty where none is.
  returned: success
  type: str
version:
  description: Version before the last change; empty where there was none.
  returned: success
  type: str
unproven:
  description: Whether nobody has proven the last change.
  returned: success
  type: bool
start:
  description: systemd's name for the present start of the unit.
  returned: success
  type: str
snapshot:
  description: Where the datastore of that time is; empty where the host holds none.
  returned: success
  type: str
"""

from typing import Any

from ansible.module_utils.basic import AnsibleModule
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import FleetError
from ansible_collections.rosops.fleet.plugins.module_utils._host.k3s_change import K3sChange

PATHS = {"type": "list", "elements": "path", "default": []}
ARGUMENTS = {
    "role": {"type": "str", "choices": ["server", "agent"], "required": True},
    "state": {"type": "str", "choices": ["staged", "next", "previous", "proven"], "required": True},
    "write": PATHS,
    "remove": PATHS,
    "datastore": {"type": "bool", "default": False},
    "start": {"type": "str", "default": ""},
}


def main() -> None:
    module = AnsibleModule(argument_spec=ARGUMENTS, supports_check_mode=True)
    params = module.params
    change, state = K3sChange(module.run_command, params["role"]), params["state"]
    before = change.record()
    changed = state in ("next", "previous") or (state == "proven" and bool(before.get("unproven")))
    try:
        if module.check_mode or state == "staged":
            record: dict[str, Any] = before
        elif state == "next":
            record = change.switch(params["write"], params["remove"])
        elif state == "previous":
            record = change.back(params["datastore"])
        else:
            change.prove(params["start"])
            record = change.record()
        staged = change.staged_version()
    except (FleetError, OSError) as error:
        module.fail_json(msg=f"k3s {state}: {error}")
    module.exit_json(
        changed=changed and state != "staged",
        staged=staged,
        version=record.get("version", ""),
        unproven=bool(record.get("unproven")),
        start=change.invocation(),
        snapshot=record.get("snapshot", ""),
    )


if __name__ == "__main__":
    main()
