#!/usr/bin/python
# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Documentation; the work is the action plugin's."""

from __future__ import annotations

DOCUMENTATION = r"""
module: fleet_info
short_description: Hosts of a fleet, and what their clusters hold
version_added: 1.0.0
description:
  - Asks the cluster of every host of the play once, all clusters side by side, and returns rows for people.
  - The fleet is what M(rosops.fleet.fleet_config) found in this run. A cluster whose servers are all unreachable is not
    asked.
  - Everything runs on the control node, so once is enough (C(run_once)).
  - M(rosops.fleet.fleet_status) shows what this returns.
options:
  volumes:
    description:
      - Name of the variable that holds, on every host, the registered result of a task that printed C(du -sb) of the
        directories below local-path's storage. It also tells which hosts are unreachable.
      - Where C(timeout) ended that (status 124 or 137), the host is among the C(problems).
    type: str
    required: true
  images:
    description:
      - Name of the variable that holds, on every host, the registered result of C(k3s crictl images -o json).
      - A pod that runs another image than its image's name means on its node is among the C(problems). Without it
        nobody looks.
    type: str
    default: ""
notes:
  - The access to each cluster is fetched from its own server over SSH, unless one is given by C(k3s_kubeconfig_path) of
    its hosts or, for the cluster C(edge), by C(K8S_AUTH_HOST), C(K8S_AUTH_KUBECONFIG) or C(K8S_AUTH_CONTEXT). A cluster
    of another fleet is a problem, and nothing of it is shown.
extends_documentation_fragment:
  - rosops.fleet._attributes.read_only
seealso:
  - module: rosops.fleet.fleet_config
  - module: rosops.fleet.fleet_status
author:
  - rosops.fleet contributors (@rosops)
"""

EXAMPLES = r"""
- name: Measure what the volumes hold
  ansible.builtin.command: timeout 30 find /var/lib/rancher/k3s/storage -mindepth 1 -maxdepth 1 -exec du -sb {} +
  become: true
  changed_when: false
  failed_when: volumes.rc | default(0) not in [0, 1, 124, 137]
  ignore_unreachable: true
  register: volumes

- name: Ask each cluster once
  rosops.fleet.fleet_info:
    volumes: volumes
  run_once: true
  register: fleet
"""

RETURN = r"""
name:
  description: The fleet's name, C(fleet_name); empty where the inventory has none.
  returned: success
  type: str
hosts:
  description: "The hosts of the play: name, group, address, role, cluster, reachable, reason."
  returned: success
  type: list
  elements: dict
nodes:
  description: "Name, ready, reason, since (when it is not ready), version, address, roles, placement, robot, labels
    (those that somebody chose)."
  returned: success
  type: list
  elements: dict
placement:
  description: "What runs on each node: node, placement, runs."
  returned: success
  type: list
  elements: dict
masters:
  description: "ROS masters: name, namespace, robot, placement, ready, wanted, nodes, addresses, images,
    restarts, ended (how a container ended in the last ten minutes that was started again), ended_at,
    since (when it is not ready), note."
  returned: success
  type: list
  elements: dict
helpers:
  description: The same of what stands beside the masters, keepers and exporters.
  returned: success
  type: list
  elements: dict
apps:
  description: The same of the inventory's apps.
  returned: success
  type: list
  elements: dict
went_back:
  description:
    - "What the keeper took back, its run having gone: name, namespace, robot, from, to, at, reason."
    - C(from) and C(to) are revisions, C(at) is RFC 3339. It stands there until the next step.
  returned: success
  type: list
  elements: dict
claims:
  description: "Name, namespace, robot, bound, unused (not bound because no app mounts it, which is in order), since
    (when it waits), phase, storage_class, size, used_bytes, note."
  returned: success
  type: list
  elements: dict
graphs:
  description:
    - Which robots are to read a ROS graph. C(robot) says whose, C(master_uri) where, C(addresses) which
      pods may be in it. A shared master's graph is read by
      the first of its robots that can be reached. It belongs to C((shared)).
  returned: success
  type: dict
  sample:
    robot1: {robot: robot1, master_uri: "http://10.43.0.17:11311", addresses: [10.42.1.7]}
promised:
  description: "What apps' readiness says of topics' rates, by graph and topic: min_rate, app, robot (whose app it is)."
  returned: success
  type: dict
  sample:
    robot1: {/imu/data: {min_rate: 90, app: bringup, robot: robot1}}
runs:
  description: The last run of each host, as its cluster keeps it for other control nodes; reports of one host each.
  returned: success
  type: list
  elements: dict
updates:
  description: The latest steps of each robot's updates, as its cluster keeps them; reports of one host each.
  returned: success
  type: list
  elements: dict
apis:
  description: Of each cluster that was asked, C(host) and C(source), the API's address and whence the access to it is.
  returned: when a cluster answered
  type: dict
problems:
  description: "What could not be looked at: where, what, todo, and C(cluster) where it is a cluster."
  returned: success
  type: list
  elements: dict
  sample:
    - where: cluster edge
      what: "does not answer: its servers are unreachable"
      todo: "ansible edge1 -b -a 'systemctl status k3s'"
      cluster: edge
"""
