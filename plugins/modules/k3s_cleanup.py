#!/usr/bin/python
# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Take k3s off a host."""

from __future__ import annotations

DOCUMENTATION = r"""
module: k3s_cleanup
short_description: Take k3s off a host
version_added: 1.0.0
description:
  - Stops k3s, ends its pods' processes, undoes its mounts, deletes its network interfaces and firewall rules, and
    removes its files.
  - Asks what runs in pods to stop, and gives it 30 seconds before it is killed.
  - Touches nothing that is not k3s's. It refuses to delete a directory in which something is still mounted.
author:
  - rosops.fleet contributors (@rosops)
options:
  volumes:
    description: Whether the data of persistent volumes (C(/var/lib/rancher/k3s/storage)) goes, too.
    type: bool
    default: false
  identity:
    description:
      - Whether the node's password goes, too. A cluster that goes on without this node knows it by that password, and
        rejects the same name with another one.
    type: bool
    default: false
attributes:
  check_mode:
    description: Lists what would go and touches nothing.
    support: full
  diff_mode:
    description: The result lists what went.
    support: none
"""

EXAMPLES = r"""
- name: Take k3s off the host, keep the robot's data
  rosops.fleet.k3s_cleanup:
"""

RETURN = r"""
removed:
  description:
    - What went, or would go in check mode, each a list.
    - C(units) stopped and deleted, C(processes) ended (their IDs), C(mounts) released, network C(interfaces) deleted,
      C(firewalls) whose rule sets held k3s's chains, and C(paths) of files and directories deleted.
  returned: success
  type: dict
"""

from ansible.module_utils.basic import AnsibleModule

from ..module_utils._common.errors import FleetError
from ..module_utils._host.k3s_remove import Remover


def main() -> None:
    module = AnsibleModule(
        argument_spec={"volumes": {"type": "bool", "default": False}, "identity": {"type": "bool", "default": False}},
        supports_check_mode=True,
    )
    remover = Remover(module.run_command, module.get_bin_path, dry=module.check_mode)
    try:
        removed = remover.everything(module.params["volumes"], module.params["identity"])
    except (FleetError, OSError) as error:
        module.fail_json(msg=f"k3s is not wholly removed: {error}. Running this again goes on where it ended.")
    module.exit_json(changed=any(removed.values()), removed=removed)


if __name__ == "__main__":
    main()
