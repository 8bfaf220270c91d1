# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Options of every module that asks a ROS 1 graph: master.ROS_ARGS."""

from __future__ import annotations


class ModuleDocFragment:
    DOCUMENTATION = r"""
options:
  master_uri:
    description:
      - URI of the ROS master, as in the environment variable E(ROS_MASTER_URI).
      - It and the addresses of the nodes must be reachable from the host that the module runs on. For a graph in a
        cluster this is any of the cluster's hosts.
    type: str
    default: http://localhost:11311
  node_timeout:
    description:
      - Seconds that the master, and each node or service, has to answer all that one look asks of it.
      - All nodes are asked at the same time, so any number of hung nodes delays a look by this once.
    type: float
    default: 2.0
requirements:
  - Python 3.8 on the host that the module runs on, and nothing else; no ROS installation
notes:
  - Nothing is registered with the master and no service is called. Reading a topic's rate or an action's status opens a
    connection to its publisher for that time, which a publisher that works only while somebody listens will notice.
"""
