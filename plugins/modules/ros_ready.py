#!/usr/bin/python
# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
from __future__ import annotations

DOCUMENTATION = r"""
module: ros_ready
short_description: Wait until the live ROS 1 graph is what it should be
version_added: 0.1.0
description:
  - Asks the ROS master and the nodes themselves until every condition holds at the same time, or O(timeout) is over.
  - A registration alone counts for nothing, because it outlives its process. A node is up when it answers, a topic is
    connected when its publishers say so, a service is there when it answers a handshake, an action when its status
    arrives.
  - A node that is dead or hung, a master that is not up yet, or a name that does not resolve are reasons to wait.
options:
  nodes:
    description: Nodes that must be registered and answer.
    type: list
    elements: str
    default: []
  topics:
    description: What topics must show. A topic with only a name, type or rate needs one publisher that answers.
    type: list
    elements: dict
    default: []
    suboptions:
      name:
        description: Name of the topic.
        type: str
        required: true
      type:
        description:
          - Message type, such as V(std_msgs/String).
          - A node that is up and has another type fails the module at once, as waiting cannot mend that.
        type: str
      publishers:
        description: Smallest number of publishers that answer.
        type: int
      subscribers:
        description: Smallest number of subscribers that answer.
        type: int
      connected:
        description:
          - Every registered subscriber must be connected to every registered publisher, by the publishers' word.
          - There must be at least one of each.
        type: bool
        default: false
      min_rate:
        description:
          - Smallest number of messages per second, summed over the topic's publishers; 1 % less still passes.
          - It is measured once all other conditions hold, for one second, or longer (up to 20) for rates below 4 Hz.
        type: float
  services:
    description: Services that must accept a connection and answer its handshake.
    type: list
    elements: dict
    default: []
    suboptions:
      name:
        description: Name of the service.
        type: str
        required: true
  actions:
    description: Actions (actionlib) that must have exactly one server that publishes its status.
    type: list
    elements: dict
    default: []
    suboptions:
      name:
        description: Name of the action, the part before C(/goal) and C(/status).
        type: str
        required: true
      state:
        description:
          - V(up) needs a living server.
          - V(idle) needs one without a goal that is pending, active, preempting or recalling in two statuses in a row,
            because a goal that is on its way stands in no list yet.
        type: str
        choices: [up, idle]
        default: up
  absent:
    description: Nodes that must be gone, their registrations, too.
    type: list
    elements: str
    default: []
  namespace:
    description: Namespace that relative names in the other options stand in.
    type: str
    default: /
  timeout:
    description: Seconds to wait. With V(0) the module looks once.
    type: float
    default: 60.0
  interval:
    description: Seconds from the start of one look to the start of the next.
    type: float
    default: 0.5
  consecutive:
    description: Number of looks in a row that must find every condition true.
    type: int
    default: 1
extends_documentation_fragment:
  - rosops.fleet._ros
  - rosops.fleet._attributes.read_only
seealso:
  - module: rosops.fleet.ros_graph_info
author:
  - rosops.fleet contributors (@rosops)
"""

EXAMPLES = r"""
- name: The robot's driver is up and its sensor is heard by everyone who asked for it
  rosops.fleet.ros_ready:
    master_uri: http://10.43.0.17:11311
    nodes: [/driver]
    topics:
      - name: /temperature
        type: std_msgs/Float64
        connected: true
        min_rate: 450
    services:
      - name: /add_two_ints

- name: Nothing is under way before the arm's server is replaced
  rosops.fleet.ros_ready:
    actions:
      - name: arm/move
        state: idle
    namespace: /robot1
    timeout: 300

- name: The old revision is gone
  rosops.fleet.ros_ready:
    absent: [/talker_1f0c2a9b]
    timeout: 10
"""

RETURN = r"""
ready:
  description: Whether every condition holds.
  returned: always
  type: bool
  sample: true
verdict:
  description: V(pass), V(wait) where the time was over, V(fail) where waiting would not have helped.
  returned: always
  type: str
  sample: pass
elapsed:
  description: Seconds from the first look to the verdict.
  returned: always
  type: float
  sample: 0.041
looks:
  description: Number of looks taken.
  returned: always
  type: int
  sample: 1
errors:
  description: Every option with a value that cannot be, where there are any; nothing was asked then.
  returned: on bad options
  type: list
  elements: str
checks:
  description: The last look, condition by condition.
  returned: always
  type: list
  elements: dict
  contains:
    kind:
      description: One of V(master), V(node), V(topic), V(rate), V(service), V(action), V(absent).
      type: str
      sample: topic
    name:
      description: What was looked at, with its full name.
      type: str
      sample: /chatter
    verdict:
      description: V(pass), V(wait) or V(fail).
      type: str
      sample: wait
    reason:
      description: What was seen, in words.
      type: str
      sample: "2 of 3 subscribers connected to /talker: missing /listener_c"
    observed:
      description: What was seen, as data; the keys depend on the kind.
      type: dict
      sample: {"type": "std_msgs/String", "missing": ["/listener_c"], "connections": 2}
"""

from typing import Any

from ansible.module_utils.basic import AnsibleModule

from ..module_utils._conditions import GATE_ARGS, WAIT_ARGS, conditions_from
from ..module_utils._errors import FleetError
from ..module_utils._gate import Look, look
from ..module_utils._poll import PASS, Polled, Seen, poll
from ..module_utils._ros_master import ROS_ARGS, RosMaster


def result_of(ended: Polled) -> dict[str, Any]:
    """What the module returns, whichever way the poll ended."""
    last: Look = ended.last
    return {
        "changed": False,
        "ready": ended.verdict == PASS,
        "verdict": ended.verdict,
        "elapsed": round(ended.elapsed, 3),
        "looks": ended.looks,
        "checks": [check.as_dict() for check in last.checks],
    }


def message_of(ended: Polled, consecutive: int) -> str:
    """Every condition that is not met, in one message."""
    last: Look = ended.last
    took = f"after {ended.elapsed:.1f} s"
    if not last.unmet:
        return f"The ROS graph was ready in {ended.passes} of {consecutive} looks in a row {took}"
    verb = "is not ready" if ended.timed_out else "cannot become ready"
    return f"The ROS graph {verb} {took}: " + "; ".join(str(check) for check in last.unmet)


def main() -> None:
    module = AnsibleModule(argument_spec={**ROS_ARGS, **WAIT_ARGS, **GATE_ARGS}, supports_check_mode=True)
    params = module.params
    try:
        conditions = conditions_from(params)
        ros = RosMaster(params["master_uri"], params["node_timeout"])

        def probe() -> Seen:
            seen = look(ros, conditions)
            return Seen(seen.verdict, seen)

        ended = poll(probe, params["timeout"], params["interval"], params["consecutive"])
    except FleetError as error:
        module.fail_json(msg=str(error), ready=False, verdict="fail", elapsed=0.0, looks=0, checks=[], **error.details)
    if ended.verdict != PASS:
        module.fail_json(msg=message_of(ended, params["consecutive"]), **result_of(ended))
    module.exit_json(**result_of(ended))


if __name__ == "__main__":
    main()
