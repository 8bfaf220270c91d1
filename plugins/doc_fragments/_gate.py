# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the ROS graph must show, the options in conditions.GATE_ARGS."""

from __future__ import annotations


class ModuleDocFragment:
    """Ansible merges this into the documentation of what extends `rosops.fleet._gate`."""

    DOCUMENTATION = r"""
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
  edges:
    description: Connections that must be there, by their publishers' word.
    type: list
    elements: dict
    default: []
    suboptions:
      publisher:
        description: The node that publishes.
        type: str
        required: true
      topic:
        description: Name of the topic.
        type: str
        required: true
      subscriber:
        description: The node that subscribes.
        type: str
        required: true
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
  namespace:
    description: Namespace that relative names in the other options stand in.
    type: str
    default: /
"""
