# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What modules that look at a ROS 1 graph take: client.ROS_ARGS, and as conditions GATE_ARGS and VALUE_ARGS."""

from __future__ import annotations


class ModuleDocFragment:
    """Ansible merges these into what extends `rosops.fleet._ros` or `._ros.gate`."""

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
attributes: # these modules only look
  check_mode: {description: 'It changes nothing, and returns the same in either mode.', support: full}
  diff_mode: {description: It changes nothing., support: N/A}
  idempotent: {description: A second run with the same options changes nothing., support: full}
requirements:
  - Python 3.8 on the host that the module runs on, and nothing else; no ROS installation
notes:
  - The module is not registered with the master and calls no service. Reading a topic's rate or an action's status
    opens a connection to its publisher for that time, which a publisher that works only while somebody listens will
    notice.
"""

    GATE = r"""
options:
  nodes:
    description:
      - Nodes that must be registered and answer.
      - Here and wherever a node is named, a name with its revision alone (V(/lidar_1a2b3c4d)) means the node of that
        revision in whatever pod it is (C(/lidar_1a2b3c4d_79d9c6f8b5)).
    type: list
    elements: str
    default: []
  topics:
    description: What topics must show. A topic with only a name, type or rate needs one publisher that answers.
    type: list
    elements: dict
    default: []
    suboptions:
      name: {description: Name of the topic., type: str, required: true}
      type:
        description: Message type, such as V(std_msgs/String). Another one of a node that is up is a failure at once.
        type: str
      publishers: {description: Smallest number of publishers that answer., type: int}
      subscribers: {description: Smallest number of subscribers that answer., type: int}
      connected:
        description:
          - Every subscriber must be connected to every publisher, by the publishers' word.
          - There must be at least one of each. One that died, or has been silent for five seconds (it sleeps), does not
            count, and is named in the reason. Nor does a tool that somebody has open (rqt, rostopic, an anonymous
            name) beside others.
        type: bool
        default: false
      min_rate:
        description:
          - Smallest number of messages per second, summed over the topic's publishers; 1 % less still passes.
          - It is measured once all other conditions hold, for one second, or longer (up to 20) for rates below 4 Hz.
        type: float
      latched:
        description:
          - Its publisher must latch, so that who subscribes later gets the last message. That is O(topics[].publisher),
            or one that answers. One that does not latch fails the module at once.
        type: bool
        default: false
      publisher:
        description:
          - A node that must publish the topic and answer. Its type, rate, latching and connections alone are judged,
            with every subscriber that answers; nobody has to subscribe.
        type: str
  services:
    description: Services that must accept a connection and answer its handshake.
    type: list
    elements: dict
    default: []
    suboptions:
      name: {description: Name of the service., type: str, required: true}
  actions:
    description: Actions (actionlib) that must have exactly one server that publishes its status.
    type: list
    elements: dict
    default: []
    suboptions:
      name: {description: 'Name of the action, the part before C(/goal) and C(/status).', type: str, required: true}
      state:
        description:
          - V(up) needs a living server.
          - V(idle) needs one without a goal that is pending, active, preempting or recalling in two statuses in a row,
            because a goal that is on its way stands in no list yet.
        type: str
        choices: [up, idle]
        default: up
  edges:
    description: Connections that must be there, by their publishers' word.
    type: list
    elements: dict
    default: []
    suboptions:
      publisher: {description: The node that publishes., type: str, required: true}
      topic: {description: Name of the topic., type: str, required: true}
      subscriber: {description: The node that subscribes., type: str, required: true}
      peer:
        description:
          - Which of the two may leave by itself. If it is not registered any more, died, or has been silent in each
            look for five seconds, the connection passes, with a note in its reason. If both are up and not connected,
            it is waited for.
        type: str
        choices: [publisher, subscriber]
  absent:
    description: Nodes that must be gone. A registration that outlived its process is none.
    type: list
    elements: str
    default: []
  namespace: {description: Namespace that relative names in the other options stand in., type: str, default: /}
  values:
    description:
      - What messages must say, or that a URL answers with 2xx. Messages are read from the publishers themselves,
        without being registered with the master, so nobody's list of subscribers changes.
      - Each item says one thing, O(values[].above) or O(values[].below) (or both), O(values[].equals),
        O(values[].quiet) or O(values[].still). A publisher that is up and cannot be heard may say anything, and is
        waited for.
    type: list
    elements: dict
    default: []
    suboptions:
      topic:
        description: Name of the topic; it or O(values[].url) is needed.
        type: str
      url:
        description:
          - C(http) or C(https), asked by GET in place of a topic. It has to answer with 2xx; any other status, and no
            answer, is waited for, with the beginning of what was said as the reason.
          - In an update the robot's keeper asks, from a pod, or its host by SSH where the keeper is away. A name has
            to be known there; an address serves both.
        type: str
      field:
        description:
          - A field of its messages, such as V(percentage), V(pose.position.x) or V(status[0].level).
          - Without it V(quiet) and V(still) look at every number but those of headers.
          - A message without such a field fails the module at once, as waiting cannot mend that.
        type: str
        default: ""
      above: {description: The field of the last message must be above this., type: float}
      below: {description: The field of the last message must be below this., type: float}
      equals: {description: 'The field of the last message must be this number, text or truth value.', type: raw}
      quiet:
        description:
          - For so many seconds nothing must have come but zeros; it is quiet, too, where nobody publishes.
          - For commands, such as C(/cmd_vel).
        type: float
      still:
        description:
          - For so many seconds nothing must have come but zeros, and something must have.
          - For what is measured, such as O(values[].field=twist.twist) of C(/odom).
        type: float
      tolerance:
        description: Numbers up to this count as zero, as nothing that is measured stands quite still.
        type: float
        default: 0.0
"""
