#!/usr/bin/python
# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
from __future__ import annotations

DOCUMENTATION = r"""
module: ros_registrations
short_description: Bring back lost registrations of living ROS 1 nodes, and remove those of dead ones
version_added: 1.0.0
description:
  - A ROS 1 node registers with the master once. A master that was restarted knows no node, and a service whose last
    provider left points to nothing although an earlier provider still lives.
  - A node that was killed stays registered, and whoever connects to it waits in vain.
  - Nodes are asked themselves before anything is changed. A registration that a newer process of the same name made is
    never touched.
options:
  state:
    description:
      - With V(present), what O(graph) has and the master has not is registered again, in the nodes' own names. Only
        nodes that answer at their recorded address, with their recorded process id where it is known, and that have the
        topic or service by their own word. Services point to the nodes of O(graph) afterwards.
      - With V(absent), all registrations of nodes that are gone are removed. A node is gone when its address refuses
        connections or cannot be reached in two looks one second apart. A node that is only late is not; it has at least
        five seconds to answer, so that it can be told from an address that is no more.
    type: str
    choices: [present, absent]
    default: present
  graph:
    description: The graph to bring back, as RV(rosops.fleet.ros_graph_info#module:graph) has it. For O(state=present).
    type: dict
  nodes:
    description:
      - Only these nodes. Without any, all nodes of O(graph), for O(state=absent) all that the master has.
    type: list
    elements: str
    default: []
attributes:
  check_mode:
    description: Asks the same and decides the same; registers and removes nothing.
    support: full
  diff_mode:
    description: Shows the registrations of the nodes concerned, before and after.
    support: full
  idempotent:
    description: A second run with the same options changes nothing.
    support: full
extends_documentation_fragment: rosops.fleet._ros
seealso:
  - module: rosops.fleet.ros_graph_info
author: rosops.fleet contributors (@rosops)
"""

EXAMPLES = r"""
- name: Remember who registered what
  rosops.fleet.ros_graph_info:
    master_uri: http://10.43.0.17:11311
  register: before

- name: The provider that survived takes its service back
  rosops.fleet.ros_registrations:
    master_uri: http://10.43.0.17:11311
    graph: "{{ before.graph }}"
    nodes: [/adder]

- name: Forget every node that is gone
  rosops.fleet.ros_registrations:
    master_uri: http://10.43.0.17:11311
    state: absent
"""

RETURN = r"""
restored:
  description: Registrations that were made, in their order.
  returned: success
  type: list
  elements: dict
  sample: [{node: /adder, kind: service, name: /add_two_ints}]
removed:
  description: Registrations that were removed, in their order.
  returned: success
  type: list
  elements: dict
  sample: [{node: /talker_1f0c2a9b, kind: publisher, name: /chatter}]
skipped:
  description: Nodes of which something was left as it is, and why.
  returned: success
  type: list
  elements: dict
  sample: [{node: /listener, reason: "nothing listens at http://10.42.1.7:41753/"}]
"""

import time
from typing import Any

from ansible.module_utils.basic import AnsibleModule

from ..module_utils._common.documents import Data
from ..module_utils._common.errors import FleetError, SpecError
from ..module_utils._ros import registrations
from ..module_utils._ros.client import ROS_ARGS
from ..module_utils._ros.graph_json import graph_from
from ..module_utils._ros.names import by_revision, is_meant
from ..module_utils._ros.registrar import Registrar
from ..module_utils._ros.registrations import Entry, Plan

REGISTRATION_ARGS: dict[str, Data] = {
    "state": {"type": "str", "choices": ["present", "absent"], "default": "present"},
    "graph": {"type": "dict"},
    "nodes": {"type": "list", "elements": "str", "default": []},
}
BETWEEN_LOOKS = 1.0
# A pod's address that is no more: its host finds that out by three ARP requests, one second each.
UNREACHABLE = 5.0


def plan_present(ros: Registrar, present: dict[str, Entry], graph: Any, nodes: list[str]) -> Plan:
    """What to register again. Only nodes of which something is missing are asked."""
    try:
        recorded = registrations.from_graph(graph_from(graph))
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise SpecError(f"graph: it is not one of ros_graph_info: {error!r}") from error
    wanted = {name: entry for name, entry in recorded.items() if not nodes or is_meant(name, nodes)}
    need = registrations.missing(wanted, present, take_services=True)
    plan = registrations.restore(need, present, ros.ask(need))
    known = {*recorded, *map(by_revision, recorded)}
    unknown = {name: "it is not in the graph" for name in nodes if name not in known}
    return Plan(plan.calls, {**plan.skipped, **unknown})


def plan_absent(ros: Registrar, present: dict[str, Entry], nodes: list[str]) -> Plan:
    """What to remove: of nodes that are gone twice. Nodes that nobody named and that live are not worth a word."""
    asked = {name: entry for name, entry in present.items() if not nodes or is_meant(name, nodes)}
    seconds = max(ros.timeout, UNREACHABLE)
    first = ros.ask(asked, seconds, own_word=False)
    suspects = {name: entry for name, entry in asked.items() if registrations.gone(entry, first[name])}
    again = {}
    if suspects:
        time.sleep(BETWEEN_LOOKS)
        again = ros.ask(suspects, seconds, own_word=False)
    plan = registrations.remove(asked, [first, {**first, **again}])
    living = {name for name, answer in first.items() if answer.verdict == registrations.ALIVE and not nodes}
    return Plan(plan.calls, {name: why for name, why in plan.skipped.items() if name not in living})


def main() -> None:
    module = AnsibleModule(
        argument_spec={**ROS_ARGS, **REGISTRATION_ARGS},
        required_if=[("state", "present", ["graph"])],
        supports_check_mode=True,
    )
    params = module.params
    try:
        ros = Registrar(params["master_uri"], params["node_timeout"])
        there = ros.snapshot()
        if params["state"] == "present":
            plan = plan_present(ros, there, params["graph"], params["nodes"])
        else:
            plan = plan_absent(ros, there, params["nodes"])
        if not module.check_mode:
            ros.apply(plan.calls)
    except FleetError as error:
        module.fail_json(msg=str(error), **error.details)
    module.exit_json(
        changed=bool(plan.calls),
        restored=[call.as_dict() for call in plan.calls if not call.remove],
        removed=[call.as_dict() for call in plan.calls if call.remove],
        skipped=[{"node": node, "reason": why} for node, why in sorted(plan.skipped.items())],
        diff=registrations.difference(there, plan.calls),
    )


if __name__ == "__main__":
    main()
