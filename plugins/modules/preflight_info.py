#!/usr/bin/python
# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Facts of a host that decide whether k3s and ROS can run on it."""

from __future__ import annotations

DOCUMENTATION = r"""
module: preflight_info
short_description: Facts that decide whether k3s can run on a host
version_added: 1.0.0
description:
  - Reads the operating system, cgroups, memory, disk, routes, sockets and traces of an earlier k3s in one call, and
    knocks at the TCP ports that the host must reach.
  - Reads only, and judges nothing. The role P(rosops.fleet.preflight#role) does.
  - Its action plugin measures the clock's offset to the control node. The measurement is bounded by the call's round
    trip, so its uncertainty is part of the result.
  - Needs nothing but Python's standard library on the host. Root is needed to name the processes that hold ports.
author:
  - rosops.fleet contributors (@rosops)
options:
  ports:
    description: Ports whose listeners are reported.
    type: list
    elements: dict
    default: []
    suboptions:
      port:
        description: Port number.
        type: int
        required: true
      protocol:
        description: Its protocol.
        type: str
        choices: [tcp, udp]
        default: tcp
  reach:
    description: TCP ports that this host must be able to reach, as C(host:port), an IPv6 address in brackets.
    type: list
    elements: str
    default: []
  timeout:
    description: Seconds to wait for an answer from a port. All ports are asked at the same time.
    type: float
    default: 3
  data_dir:
    description: The directory whose file system must hold k3s's data. It need not exist.
    type: path
    default: /var/lib/rancher
extends_documentation_fragment:
  - rosops.fleet._attributes.read_only
"""

EXAMPLES = r"""
- name: Look at the host
  rosops.fleet.preflight_info:
    ports:
      - port: 6443
    reach:
      - edge1:6443
  register: host
"""

RETURN = r"""
facts:
  description:
    - What was read. Besides the named keys C(hostname), C(machine_id), C(kernel), C(board), C(systemd), C(root),
      C(overlay) and C(k3s) (traces of an earlier installation).
  returned: success
  type: dict
  contains:
    machine:
      description: Hardware name, as C(uname -m) says it.
      type: str
      sample: aarch64
    cgroup:
      description:
        - Version, controllers that are on, the boot command line and the file it comes from. C(refused) is whether a
          k3s 1.35 or newer does not start with this version.
      type: dict
    memory_mb:
      description: Memory in MiB.
      type: int
    disk:
      description: Size, free space and type of the file system below O(data_dir).
      type: dict
    routes:
      description: Default routes with interface, gateway and MTU.
      type: list
      elements: dict
    network:
      description:
        - Firewalls that are on, SELinux' mode and whether k3s's policy is there, and what the kernel lacks of the
          modules for the pods' network.
      type: dict
    listening:
      description: Which of O(ports) are taken, and by which process.
      type: list
      elements: dict
    reach:
      description: The entries of O(reach) as C(host), C(port) and C(outcome). C(open) and C(refused) are answers.
      type: list
      elements: dict
    clock:
      description:
        - The host's clock minus the control node's in seconds (C(offset)), and by how much that may be wrong
          (C(uncertainty)).
      type: dict
      sample: {offset: 0.02, uncertainty: 0.11}
"""

import time

from ansible.module_utils.basic import AnsibleModule
from ansible_collections.rosops.fleet.plugins.module_utils._host.facts import Host, collect
from ansible_collections.rosops.fleet.plugins.module_utils._host.network_facts import network


def main() -> None:
    began = time.time()
    module = AnsibleModule(
        argument_spec={
            "ports": {
                "type": "list",
                "elements": "dict",
                "default": [],
                "options": {
                    "port": {"type": "int", "required": True},
                    "protocol": {"type": "str", "choices": ["tcp", "udp"], "default": "tcp"},
                },
            },
            "reach": {"type": "list", "elements": "str", "default": []},
            "timeout": {"type": "float", "default": 3},
            "data_dir": {"type": "path", "default": "/var/lib/rancher"},
        },
        supports_check_mode=True,
    )
    host, params = Host(), module.params
    facts = {**collect(host, params["ports"], params["reach"], params), "network": network(host)}
    # Both readings, for the action plugin: the time in between is the module's own work, no part of the way.
    facts["clock"] = {"began": began, "ended": time.time()}
    module.exit_json(changed=False, facts=facts)


if __name__ == "__main__":
    main()
