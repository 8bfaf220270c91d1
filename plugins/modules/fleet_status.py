#!/usr/bin/python
# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Documentation; the work is the action plugin's."""

from __future__ import annotations

DOCUMENTATION = r"""
module: fleet_status
short_description: Show how a fleet stands
version_added: 1.0.0
description:
  - Prints what needs attention, each finding under its cause, with the time since when and what to do next.
  - Holds topics' rates against what apps' readiness promises, and tells of containers that ended in the last ten
    minutes and were started again.
  - Prints how many hosts, nodes, masters, helpers, apps, ROS nodes, claims and last outcomes are in order. What is not
    known counts as unknown, never as good.
  - With C(-v) prints tables of all of them, of topics with live rates, and of the last updates' steps.
  - Writes all of it on the control node as a page for the browser.
  - The page is one file without scripts. It loads nothing, and everything in it is escaped. It is written only when it
    says something new beside the time.
  - Everything runs on the control node, so once is enough (C(run_once)).
options:
  fleet:
    description: What M(rosops.fleet.fleet_info) returned.
    type: dict
    required: true
  graphs:
    description: Name of the variable that holds, on the robots that C(fleet.graphs) names, the registered result of
      M(rosops.fleet.ros_graph_info).
    type: str
    required: true
  page:
    description:
      - Where the page goes. Relative to the directory of the ansible.cfg in use, or without one to the current
        directory.
      - Empty writes none.
    type: str
    default: reports/fleet-status.html
  mode:
    description: Who may read the page; V(0644) for a web server.
    type: str
    choices: ["0600", "0640", "0644"]
    default: "0600"
notes:
  - The last outcomes are those that the clusters keep, and those that the callback
    P(rosops.fleet.fleet_report#callback) has written here, under the name that its option C(path) gives or one that
    begins with it; of each host the newer one.
  - Returns C(outcome), V(unchanged), for that callback. Looking changes no host.
attributes:
  check_mode:
    description: Shows all, writes no page, and tells whether there would be a new one.
    support: full
  diff_mode:
    description: Returns details on what has changed in diff mode.
    support: none
    details:
      - A page of HTML is no diff that anybody reads. What is in it was shown.
  idempotent:
    description: A second run with the same options changes nothing.
    support: full
seealso:
  - module: rosops.fleet.fleet_info
  - module: rosops.fleet.ros_graph_info
author:
  - rosops.fleet contributors (@rosops)
"""

EXAMPLES = r"""
- name: Read the ROS graphs, each on a robot's own host
  rosops.fleet.ros_graph_info:
    master_uri: "{{ fleet.graphs[inventory_hostname].master_uri }}"
    rates: true
  when: inventory_hostname in fleet.graphs
  failed_when: false
  register: graph

- name: Show how the fleet stands
  rosops.fleet.fleet_status:
    fleet: "{{ fleet }}"
    graphs: graph
  run_once: true
"""

RETURN = r"""
status:
  description:
    - Lists of rows under C(problems), C(hosts), C(nodes), C(placement), C(masters), C(helpers), C(apps), C(went_back),
      C(ended), C(ros_nodes), C(links), C(topics), C(claims), C(outcomes), C(steps). Those that are not here are as
      M(rosops.fleet.fleet_info) returns them.
    - "C(problems): where, what, and where it is known todo, what to do next; C(cluster) or C(graph) where it is that
      which cannot be looked at. Among them are the processes of launch files that crashed or were started again, each
      by the app that it belongs to, and containers that ended lately."
    - "C(ended), processes of launch files that have ended, nobody but the pod's log knows with what exit code: robot,
      app, node, host."
    - "C(ros_nodes): robot, name, at (the host that it runs on, or the address of a process that no pod has), app,
      reachable, error, publications, subscriptions, services."
    - "C(links), who hears whom in the ROS graphs: robot, name, action, publishers, subscribers, and as broken the pairs
      of these that are registered and alive and not connected. The topics of an action are one link."
    - "C(topics): robot, name, type, publishers, subscribers, connections, rate, promised (min_rate, app, robot of the
      app whose readiness names one), note; without rosout and clock."
    - "C(outcomes), of the newest report that has the host, but for those of check mode and of playbooks that only look:
      host, outcome, playbook, started, changed, note."
    - "C(steps), of the robot's newest update: robot, id, name, handoff, outcome, from, to, seconds, busy_wait, phases,
      note."
  returned: success
  type: dict
text:
  description: What was printed.
  returned: success
  type: str
"""
