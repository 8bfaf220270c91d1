#!/usr/bin/python
# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Documentation of the action plugin robot_update; nothing of it runs on a host."""

from __future__ import annotations

DOCUMENTATION = r"""
module: robot_update
short_description: Make a robot, or change what runs on it, one gated step at a time
version_added: 1.0.0
author: rosops.fleet contributors (@rosops)
description:
  - Compares the robot's apps and its ROS master with the inventory. What is as it should be is not touched.
  - On a robot on which no app is at work all that is new comes at once, is awaited together, and the graph has to be
    what its apps promise. What does not come up stays as it is; the rest is at work from then on. Else it goes step by
    step.
  - Namespace, quota, limits, pull secrets, claims and the code in the pods change without a step; no pod is touched.
  - Each changed app, each group of apps (C(update.group)) and the master is a step, in the order of C(depends_on). A
    step records what the app is to the ROS graph, waits until a busy robot is idle, applies the new version, waits
    until the pods have handed over, and holds the graph against the record. What does not hold is taken back.
  - The robot's outcome is RV(outcome). The task itself does not fail because of it, and a robot that cannot be reached,
    or on which Ansible cannot work, is an outcome, too.
  - One run changes a robot at a time, by the Lease C(robot-update) in its namespace. A second one ends as
    C(deferred-busy) and says who has the robot. The Lease of a run that was killed is waited out for 15 seconds.
  - Every 10 seconds it says what is waited for, and with C(-v) each phase as it begins.
notes:
  - Reads what the playbook C(rosops.fleet.validate) worked out, which has to be imported first.
  - The work is done by an action plugin on the control node, which asks the Kubernetes API itself and runs modules of
    this collection on the robot's host. They need root there to see the sockets of pods.
  - SIGINT, SIGTERM and the end of ansible-playbook itself (SIGKILL) end the step where it stands and let held goals
    go. What was applied by then stays marked as
    unproven, with the way back beside it, and the next run takes the step up.
options:
  parts:
    description:
      - What of the robot. V(ready) waits in the end until all of it is rolled out and its ROS graph is what its apps
        promise, whether or not anything was changed.
      - Where the run has tags of these names (C(--tags), C(--skip-tags)), only the parts that they mean.
    type: list
    elements: str
    choices: [namespace, storage, master, apps, ready]
    default: [namespace, storage, master, apps]
  at_work:
    description:
      - Whether a robot at work may be changed. If not, and it has to be, nothing is done, and RV(at_work) is true; a
        robot that runs nothing yet, or is as it should be, is done with.
    type: bool
    default: true
  strict:
    description: Fail where the robot is not as the inventory says; in check mode where a run would have V(failed).
    type: bool
    default: false
  rollout_timeout:
    description: Seconds until what was made, and with V(ready) all of the robot, has to be rolled out.
    type: float
    default: 300
  remove_claims:
    description:
      - Names of volumes whose claims are deleted in the end, with their data. The inventory must not have them any
        more, and nothing that runs may mount them.
    type: list
    elements: str
    default: []
  remove_confirm:
    description: Has to be true before a claim is deleted.
    type: bool
    default: false
  remove_apps:
    description:
      - Names of apps that the inventory has no more and that are taken away, or V(all) for whatever of the robot it
        has no more. Each is a step of its own, gated like an update. Claims are left.
    type: list
    elements: str
    default: []
  apps:
    description: Change only these apps; V(ros-master) is the master. Empty means all that differ from the inventory.
    type: list
    elements: str
    default: []
  to:
    description: Empty for what the inventory says, V(previous) or a revision to go back to.
    type: str
    default: ""
  shared:
    description:
      - Whether what belongs to the whole fleet (a shared master, apps of scope V(fleet)) is this robot's to change.
    type: bool
    default: true
  on_busy:
    description:
      - What to do with a robot whose actions are busy. V(wait) for O(busy_timeout), V(defer) at once, V(force) it.
      - An app's own C(update.on_busy) counts for its step.
    type: str
    choices: [wait, defer, force]
    default: wait
  busy_timeout:
    description: Seconds to wait for a busy robot; then it is deferred to the next run.
    type: float
    default: 600
  ready_timeout:
    description:
      - Seconds until a new version has to be ready; then it is taken back. Those that the old one has for its end are
        not counted.
    type: float
    default: 120
  verify_seconds:
    description:
      - Seconds for which a new version has to work on, once the old one is gone, until it is proven. If one of its
        containers ends by then, it is taken back. The graph has to be as it was recorded at their begin and their end.
      - Each step of a robot takes so long. Robots of a wave wait at the same time.
    type: float
    default: 10
  rate_tolerance:
    description: How much a topic's rate may fall below the recorded one, as a share of it.
    type: float
    default: 0.1
  rate_seconds:
    description: Seconds to measure rates for when the graph is recorded.
    type: float
    default: 1
  own:
    description:
      - Whether what is this robot's own is changed. With V(false) only what is the whole fleet's is, once in a run by
        the first robot that can, however many are told so. A play over all robots that does so before the others
        changes a shared master while nobody hands over.
    type: bool
    default: true
  come_back:
    description:
      - Whether the caller comes back to a robot that works. The first look then takes no time, and every later one at
        least 8 seconds or a fiftieth of O(busy_timeout), until that is over. Meanwhile RV(waiting) is true, and there
        is no RV(outcome). So robots that work do not keep Ansible's forks from those that rest.
      - Otherwise it waits for all of O(busy_timeout).
    type: bool
    default: false
  failure_budget:
    description:
      - How many robots (a number, or a percentage of the play's) may fail or be rolled back before no further wave
        (batch of C(serial)) begins.
    type: str
    default: "0"
  image_archives:
    description: Archives of images on the control node, as the role C(images) takes them.
    type: list
    elements: dict
    default: []
  image_names:
    description: Further images to have on the node.
    type: list
    elements: str
    default: []
  image_rate_limit:
    description: Upper limit of a transfer, as rsync's C(--bwlimit).
    type: str
    default: ""
  image_directory:
    description: Where archives lie on the host until they are imported.
    type: str
    default: /var/lib/rancher/rosops-fleet-images
extends_documentation_fragment:
  - rosops.fleet._k8s_auth
attributes:
  check_mode:
    description: Says what would change, and whether the robot could go now. Nothing is written, and nobody waits.
    support: full
  diff_mode:
    description: Shows the objects before and after.
    support: full
"""

EXAMPLES = r"""
# after the playbook rosops.fleet.validate, which is imported first
- name: Robots are updated, a tenth at a time
  hosts: robots
  serial: 10%
  tasks:
    - name: Take the robot's steps
      rosops.fleet.robot_update:
        on_busy: defer
      become: true
"""

RETURN = r"""
verdict:
  description: Of the look at the whole robot's graph, V(pass) or V(fail).
  returned: where the graph was looked at as a whole
  type: str
elapsed:
  description: Seconds that this look took.
  returned: where the graph was looked at as a whole
  type: float
outcome:
  description:
    - What became of the robot. C(outcome) is V(updated), V(unchanged), V(deferred-offline), V(deferred-busy),
      V(rolled-back) or V(failed), C(reason) says why, and C(steps) are the steps that were begun, each with its
      C(phases) in seconds.
  returned: always, but for what is left for a later task
  type: dict
waiting:
  description: The robot works, and the caller has to come back.
  returned: with O(come_back), when so
  type: bool
at_work:
  description: The robot is at work and has to be changed. It has no outcome yet.
  returned: with O(at_work=false), when so
  type: bool
"""
