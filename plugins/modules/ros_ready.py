#!/usr/bin/python
# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
from __future__ import annotations

DOCUMENTATION = r"""
module: ros_ready
short_description: Wait until the live ROS 1 graph is what it should be
version_added: 1.0.0
description:
  - Asks the ROS master and the nodes themselves until every condition holds at the same time, or O(timeout) is over.
  - A registration alone counts for nothing, because it outlives its process. A node is up when it answers, a topic is
    connected when its publishers say so, a service is there when it answers a handshake, an action when its status
    arrives.
  - A node that is dead or hung, a master that is not up yet, or a name that does not resolve are reasons to wait.
options:
  timeout: {description: Seconds to wait. With V(0) the module looks once., type: float, default: 60.0}
  interval: {description: Seconds from the start of one look to the start of the next., type: float, default: 0.5}
  consecutive: {description: Number of looks in a row that must find every condition true., type: int, default: 1}
  stable:
    description:
      - Seconds for which every look must find every condition true. One that does not starts the count over.
      - They are part of the O(timeout).
    type: float
    default: 0.0
extends_documentation_fragment:
  - rosops.fleet._ros.gate
  - rosops.fleet._ros
seealso:
  - module: rosops.fleet.ros_graph_info
author: rosops.fleet contributors (@rosops)
"""

EXAMPLES = r"""
- name: The robot's driver is up and its sensor is heard by everyone who asked for it
  rosops.fleet.ros_ready:
    master_uri: http://10.43.0.17:11311
    nodes: [/driver]
    topics:
      - {name: /temperature, type: std_msgs/Float64, connected: true, min_rate: 450}
    services:
      - name: /add_two_ints

- name: Nothing is under way before the arm's server is replaced
  rosops.fleet.ros_ready:
    actions:
      - {name: arm/move, state: idle}
    namespace: /robot1
    timeout: 300

- name: The robot stands, nobody steers it, and its battery will do
  rosops.fleet.ros_ready:
    values:
      - {topic: /odom, field: twist.twist, still: 5, tolerance: 0.01}
      - {topic: /cmd_vel, quiet: 5}
      - {topic: /battery, field: percentage, above: 0.4}
    timeout: 600
"""

RETURN = r"""
ready:
  description: Whether every condition holds.
  returned: always
  type: bool
verdict:
  description: V(pass), V(wait) where the time was over, V(fail) where waiting would not have helped.
  returned: always
  type: str
  sample: pass
elapsed:
  description: Seconds from the first look to the verdict.
  returned: always
  type: float
looks:
  description: Number of looks taken.
  returned: always
  type: int
errors:
  description: Every option with a value that cannot be, where there are any; nothing was asked then.
  returned: on bad options
  type: list
  elements: str
held:
  description: Seconds for which every look had found every condition true at the end.
  returned: when the graph was looked at
  type: float
checks:
  description:
    - The last look, condition by condition, each with its C(verdict) and in C(reason) what was seen, in words.
    - C(kind) is V(master), V(node), V(topic), V(rate), V(service), V(action), V(edge), V(absent) or V(value), C(name)
      the full name of what was looked at. C(observed) is what was seen, as data whose keys depend on the kind.
  returned: always
  type: list
  elements: dict
  sample:
    - kind: topic
      name: /chatter
      verdict: wait
      reason: "2 of 3 subscribers connected to /talker: missing /listener_c"
      observed: {type: std_msgs/String, missing: [/listener_c], connections: 2}
"""

from ansible.module_utils.basic import AnsibleModule

from ..module_utils._common.errors import FleetError
from ..module_utils._ros.client import ROS_ARGS
from ..module_utils._ros.conditions import GATE_ARGS, VALUE_ARGS, WAIT_ARGS
from ..module_utils._ros.jobs import ready


def main() -> None:
    spec = {**ROS_ARGS, **WAIT_ARGS, **GATE_ARGS, **VALUE_ARGS}
    module = AnsibleModule(argument_spec=spec, supports_check_mode=True)
    try:
        result = ready(module.params)
    except FleetError as error:
        module.fail_json(msg=str(error), ready=False, verdict="fail", elapsed=0.0, looks=0, checks=[], **error.details)
    if not result["ready"]:
        module.fail_json(**result)
    module.exit_json(**result)


if __name__ == "__main__":
    main()
