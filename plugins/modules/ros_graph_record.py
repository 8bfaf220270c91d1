#!/usr/bin/python
# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
from __future__ import annotations

DOCUMENTATION = r"""
module: ros_graph_record
short_description: Record a live ROS 1 graph, without its messages
version_added: 1.0.0
description:
  - Returns who is in a ROS 1 graph and how they are connected, in a form that is kept in a file and played again by
    C(rosops.fleet.rehearse).
  - It has no message, and of parameters no value that is not asked for by O(values), as they may be secret.
  - Tools that somebody has open, the keeper, C(/rosout), the logger services and nodes that do not answer are left out.
options:
  robot:
    description: The robot whose graph it is, as O(apps) calls it.
    type: str
    default: ""
  apps:
    description:
      - The fleet's apps, each with C(name), C(robot), C(placement) and C(addresses), those of its pods. By them nodes
        are found to be an app's, and their names are recorded without the revision.
    type: list
    elements: dict
    default: []
  rate_seconds:
    description:
      - Seconds over which the publishers count what they send to those who listen. What nobody listens to has no rate.
    type: float
    default: 10.0
  values:
    description: Parameters whose values are recorded; a name stands for all below it, too, V(/) for all there are.
    type: list
    elements: str
    default: []
extends_documentation_fragment:
  - rosops.fleet._ros
  - rosops.fleet._attributes.read_only
seealso:
  - module: rosops.fleet.ros_graph_info
author:
  - rosops.fleet contributors (@rosops)
"""

EXAMPLES = r"""
- name: Record a robot's graph
  rosops.fleet.ros_graph_record:
    master_uri: http://10.43.0.17:11311
    robot: robot1
    apps: "{{ fleet.apps }}"
  register: recorded
"""

RETURN = r"""
recording:
  description:
    - The graph. C(apps) and C(others) say whose the nodes are, C(parameters) of which type each parameter is.
    - A topic's C(publishers) have the C(rate) of each one in messages per second, or null where nobody listened, and
      whether it is C(latched). C(edges) are publisher and subscriber, by the publishers' word.
    - C(version) is that of the form.
  returned: success
  type: dict
  sample:
    kind: rosops.fleet/recording
    version: 1
    robot: robot1
    apps:
      chatter: {placement: local, nodes: [/talker]}
    others: [/listener]
    topics:
      /chatter:
        type: std_msgs/String
        md5sum: 992ce8a1687cec8c8bd883ec73ca41d1
        definition: "string data\n"
        publishers:
          /talker: {rate: 500.2, latched: false}
        subscribers: [/listener]
        edges: [[/talker, /listener]]
    services:
      /trigger: {provider: /talker, type: std_srvs/Trigger, md5sum: 937c9679a518e3a18d831e57125ea522}
    actions: {}
    parameters: {/talker/rate: int}
    values: {}
"""

from typing import Any, Mapping, Sequence

from ansible.module_utils.basic import AnsibleModule

from ..module_utils._common.errors import FleetError, RosError
from ..module_utils._pod.launch import stable
from ..module_utils._ros.client import ROS_ARGS, Ros1Client
from ..module_utils._ros.counters import sent
from ..module_utils._ros.graph import Graph, everything, host_of
from ..module_utils._ros.recording import Findings, Recording, flat, recorded

RECORD_ARGS = {
    "robot": {"type": "str", "default": ""},
    "apps": {"type": "list", "elements": "dict", "default": []},
    "rate_seconds": {"type": "float", "default": 10.0},
    "values": {"type": "list", "elements": "str", "default": []},
}


def read(ros: Ros1Client, params: Mapping[str, Any]) -> Recording:
    """The recording of what is there now."""
    own = [app for app in params["apps"] if app["robot"] == params["robot"]]
    state = ros.state(types=True)
    graph = ros.ask(state, everything(state))
    alive = {
        name: tuple(one for one in topic.publishers if graph.nodes[one].reachable)
        for name, topic in graph.topics.items()
    }
    owners = owners_of(graph, own)
    found = Findings(
        graph,
        ros.greeted(graph, [(topic, publisher) for topic, names in alive.items() for publisher in names]),
        sent(ros, graph, alive, params["rate_seconds"]),
        parameters(ros),
        owners,
        {node: stable(node) for node in owners},
    )
    return recorded(params["robot"], found, {app["name"]: app["placement"] for app in own}, params["values"])


def owners_of(graph: Graph, apps: Sequence[Mapping[str, Any]]) -> dict[str, str]:
    """Node -> its app, by its pod's address. One that several share, that of a host, tells nothing."""
    at: dict[str, list[str]] = {}
    for app in apps:
        for address in app["addresses"]:
            at.setdefault(address, []).append(app["name"])
    hosts = {name: at.get(host_of(node.uri), []) for name, node in graph.nodes.items()}
    return {name: found[0] for name, found in hosts.items() if len(found) == 1}


def parameters(client: Ros1Client) -> dict[str, Any]:
    """All that the parameter server has, by whole name."""
    [tree] = client.calls([("getParam", client.caller, "/")])
    if isinstance(tree, RosError):
        raise tree
    return dict(flat(tree))


def main() -> None:
    module = AnsibleModule(argument_spec={**ROS_ARGS, **RECORD_ARGS}, supports_check_mode=True)
    params = module.params
    if not 0 < params["rate_seconds"] <= 3600:
        module.fail_json(msg=f"rate_seconds: {params['rate_seconds']} is not between 0 and 3600 s")
    try:
        found = read(Ros1Client(params["master_uri"], params["node_timeout"]), params)
    except FleetError as error:
        module.fail_json(msg=str(error), **error.details)
    module.exit_json(changed=False, recording=found.as_dict())


if __name__ == "__main__":
    main()
