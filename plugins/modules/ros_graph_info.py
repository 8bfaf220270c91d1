#!/usr/bin/python
# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
from __future__ import annotations

DOCUMENTATION = r"""
module: ros_graph_info
short_description: Read the live ROS 1 graph
version_added: 1.0.0
description:
  - Returns nodes, topics, services and actions of a ROS 1 graph as the master and the nodes themselves tell them, and
    what launch files have started.
  - A node that is registered but does not answer stands in it with the reason. Only a master that does not answer fails
    the module.
options:
  nodes:
    description:
      - Ask only these nodes, those they exchange messages with, and their services; of a fleet that shares a master
        that is little. All actions are asked. What else is registered stands in the graph as not asked (C(reachable)
        is false, C(error) empty).
      - Empty means everything.
    type: list
    elements: str
    default: []
  rates: {description: 'Measure the topics'' messages per second.', type: bool, default: false}
  rate_source:
    description:
      - V(messages) subscribes and counts what comes, of each publisher.
      - V(counters) subscribes to nothing. It asks the publishers twice how much they have sent to those who listen, so
        it tells only of topics that somebody listens to, no publisher that works on demand begins to work, and
        C(rates) stays empty.
    type: str
    choices: [messages, counters]
    default: messages
  rate_topics: {description: Measure these topics only; by default all., type: list, elements: str}
  rate_nodes:
    description:
      - Measure only what these nodes publish, and only where somebody listens to it already, so that no publisher that
        works on demand (image_transport) begins to work. O(md5sums) then are those of these topics, too.
      - Empty means all nodes and all of their topics.
    type: list
    elements: str
    default: []
  rate_seconds:
    description:
      - Seconds to measure for; all topics are measured at the same time.
      - A publisher that has sent too little by then to know its rate is listened to until it has, up to some six
        seconds longer, as long as its messages are not much more than a second apart.
    type: float
    default: 2.0
  md5sums:
    description: Ask a publisher of each topic for its message type's md5sum, which takes one more connection each.
    type: bool
    default: false
  definitions:
    description: Return with each md5sum that O(md5sums) asks for the text that defines the type, too.
    type: bool
    default: false
  launch_hosts:
    description:
      - Addresses of pods that are there. What launch files have started in them is read, too, where none of their nodes
        is registered.
    type: list
    elements: str
    default: []
extends_documentation_fragment: rosops.fleet._ros
seealso:
  - module: rosops.fleet.ros_ready
author: rosops.fleet contributors (@rosops)
"""

EXAMPLES = r"""
- name: Read a robot's graph with its rates
  rosops.fleet.ros_graph_info:
    master_uri: http://10.43.0.17:11311
    rates: true
  register: ros

- name: Read what an update of an app has to know
  rosops.fleet.ros_graph_info:
    rates: true
    rate_nodes: [/temperature_publisher]
    md5sums: true
  register: before

- name: Show what is registered but does not answer
  ansible.builtin.debug:
    msg: "{{ ros.graph.nodes | dict2items | rejectattr('value.reachable') | map(attribute='key') }}"
"""

RETURN = r"""
graph:
  description: The graph.
  returned: success
  type: dict
  contains:
    nodes:
      description: By name, what each registered node is.
      type: dict
      sample:
        /talker: {uri: "http://10.42.1.7:41753/", pid: 1, reachable: true, error: "", refused: false,
                  publications: [/chatter, /rosout], subscriptions: [], services: [/talker/get_loggers]}
    topics:
      description:
        - By name, who publishes and who subscribes, by the master's word.
        - C(connections) are those that the publishers report.
        - C(rate) is null where it was not or could not be measured, or the messages were too few to tell, which
          C(rate_error) says.
        - C(rates) has the publishers whose rate may be expected of them from now on. One that sends irregularly, when
          something happens, is not in it, nor one with too few messages. What a publisher sends all at once after it
          was held up does not count.
        - C(unsteady) has what the other publishers sent per second while they were listened to.
        - C(latched) lists the publishers that latch, of those that were asked for an md5sum or whose rate was measured.
          A message that had been sent before anybody listened is in no rate.
        - C(md5sum) is null where it was not asked for, or no publisher answers. Where one does, and O(definitions) is
          set, C(definition) is the text of the type and of those within it.
      type: dict
      sample:
        /chatter: {type: std_msgs/String, md5sum: 992ce8a1687cec8c8bd883ec73ca41d1, publishers: [/talker],
                   subscribers: [/listener], connections: [{publisher: /talker, subscriber: /listener}],
                   rate: 499.8, rates: {/talker: 499.8}, unsteady: {}, latched: [], rate_error: ""}
    services:
      description: By name, who registered it, and who answers at its address (C(provider)).
      type: dict
      sample:
        /add_two_ints: {providers: [/adder], uri: "rosrpc://10.42.1.9:40133", provider: /adder, error: "",
                        type: example/AddTwoInts, md5sum: 6a2e34150c00229791cc89ff309fff21, up: true}
    actions:
      description: By name, the actions that have a whole server, with the number of listed goals by state.
      type: dict
      sample:
        /arm/move: {type: example/MoveAction, servers: [/arm], clients: [/planner], up: true, busy: true,
                    goals: {ACTIVE: 1, SUCCEEDED: 2}}
    launched:
      description:
        - The processes that launch files have started, by the word of the roslaunch that runs where one of the nodes is
          registered (with O(nodes), one of those), or at one of O(launch_hosts).
        - C(crash) says in words what is wrong, and is empty where nothing is, or nobody can tell.
          A roslaunch that C(ros_apps[].launch) did not start forgets the exit code of a process that has ended and is
          not started again, so C(exit_code) is null then. Such a process has crashed if it has left its registration
          behind, else it may have done its work.
        - C(spawned) is how many times it was started, C(host) the address of its pod.
      type: list
      elements: dict
      sample:
        - {name: arm/lidar-3, node: /arm/lidar, host: 10.42.1.7, alive: true, exit_code: null, respawn: true,
           required: false, spawned: 5, crash: was started again 4 times}
elapsed:
  description: Seconds that it took.
  returned: success
  type: float
"""

from ansible.module_utils.basic import AnsibleModule

from ..module_utils._common.errors import FleetError
from ..module_utils._ros.client import ROS_ARGS
from ..module_utils._ros.jobs import INFO_ARGS, graph


def main() -> None:
    module = AnsibleModule(argument_spec={**ROS_ARGS, **INFO_ARGS}, supports_check_mode=True)
    try:
        module.exit_json(**graph(module.params))
    except FleetError as error:
        module.fail_json(msg=str(error), **error.details)


if __name__ == "__main__":
    main()
