#!/usr/bin/python
# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Check a whole fleet's inventory before anything is touched."""

from __future__ import annotations

DOCUMENTATION = r"""
module: fleet_config
short_description: Check the whole fleet's variables before anything is touched
version_added: 1.0.0
author: rosops.fleet contributors (@rosops)
description:
  - Checks groups, robots, apps, volumes and masters of the inventory, one by one and against each other.
  - Reports all errors at once, each with the path of the value, what is wrong with it and what is allowed. What is
    wrong in the same way on several hosts, as a group's variable is, is one error.
  - Returns the fleet with every default filled in, in which later tasks find what they need. It holds no password and
    no token; an app's own environment is in it as it stands in the inventory.
  - Reads the archives in C(images_archives) that lie on the control node, where an app leaves open what its image has.
  - Runs on the control node, inside Ansible's own process. It contacts no host and no cluster and changes nothing.
options: {}
extends_documentation_fragment:
  - rosops.fleet._attributes.read_only
attributes:
  action:
    description: Has an action plugin, in which everything is done on the control node.
    support: full
notes:
  - The playbook C(rosops.fleet.validate) is all that is needed to run it; the other playbooks import that one.
"""

EXAMPLES = r"""
- name: Check the inventory, and keep the fleet for every host of the run
  rosops.fleet.fleet_config:
  register: fleet
  run_once: true
"""

RETURN = r"""
valid:
  description: Whether the fleet can be brought up as it is described. With errors the task fails.
  returned: always
  type: bool
errors:
  description: All errors.
  returned: always
  type: list
  elements: dict
  contains:
    path:
      description: The path of the value.
      type: str
      sample: hosts.robot1.ros_apps[2].placement
    problem:
      description: What is wrong.
      type: str
      sample: is 'cloud'
    allowed:
      description: What would be right.
      type: str
      sample: local or remote
    hosts:
      description: All hosts of which that is so; the path is the first one's. None where it is no host's.
      type: list
      elements: str
    app:
      description: The name of the app at this path; empty where it is no app's.
      type: str
robots:
  description: The robots by name, each with every default filled in.
  returned: if there are no errors
  type: dict
hosts:
  description:
    - The hosts by name, each with its C(role) (C(server) or C(agent)), its C(cluster), that cluster's C(servers),
      whether it starts the cluster (C(init)), and the name of its C(node) there.
  returned: if there are no errors
  type: dict
remote_images:
  description: The images of the robots' remote pods.
  returned: if there are no errors
  type: list
  elements: str
edge_nodes:
  description: The names of the edge hosts' nodes.
  returned: if there are no errors
  type: list
  elements: str
"""
