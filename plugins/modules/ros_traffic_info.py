#!/usr/bin/python
# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
from __future__ import annotations

DOCUMENTATION = r"""
module: ros_traffic_info
short_description: Listen to a ROS 1 graph for a time, and say what was lost
version_added: 1.0.0
description:
  - Listens to every topic that somebody listens to, from the outside and without being registered, until a file is
    there. Meanwhile nodes may be replaced, as an update does it.
  - Messages whose type begins with a C(Header) have a number, which ROS' client libraries count up for each publisher.
    Of one publisher none may be missing. Messages of other types are only counted.
  - An app that once listened to a topic has to be connected in every later look, some of them a second, by the
    publishers' word. The revision at the end of a node's name, as C(overlap) gives it, does not count.
  - It is an account of its own, for tests. It costs a robot's CPU what one more subscriber of each topic costs.
options:
  end_file:
    description: The module returns when this file is there.
    type: path
    required: true
  seconds:
    description: The module fails if the file is not there by then.
    type: int
    default: 3600
  may_pause:
    description:
      - Topics of which no connection and no number is missed, such as those of an app that stops before its next
        version starts.
    type: list
    elements: str
    default: []
extends_documentation_fragment:
  - rosops.fleet._ros
  - rosops.fleet._attributes.read_only
seealso:
  - module: rosops.fleet.ros_graph_info
author: rosops.fleet contributors (@rosops)
"""

EXAMPLES = r"""
- name: Listen to the robot, beside what comes
  rosops.fleet.ros_traffic_info:
    master_uri: http://10.43.0.17:11311
    end_file: /run/listened.end
  async: 3600
  poll: 0
  register: listening
"""

RETURN = r"""
problems:
  description: What was lost, a line each; empty if nothing was.
  returned: success
  type: list
  elements: str
  sample: ["/scan: 12 of 4000 messages are missing"]
topics:
  description:
    - By name, what came. C(missing) is null where messages have no number. C(longest_gap) is in seconds.
    - C(unconnected_looks) has each app that listens, and in how many looks it was not connected.
  returned: success
  type: dict
  sample:
    /scan: {messages: 4000, publishers: 2, numbered: true, missing: 0, longest_gap: 0.11,
            unconnected_looks: {/mapping: 0}}
looks:
  description: How often it was seen who is connected.
  returned: success
  type: int
"""

import time
from pathlib import Path

from ansible.module_utils.basic import AnsibleModule

from ..module_utils._common.errors import FleetError, RosError
from ..module_utils._ros.client import ROS_ARGS, Ros1Client
from ..module_utils._ros.traffic import Watcher

TRAFFIC_ARGS = {
    "end_file": {"type": "path", "required": True},
    "seconds": {"type": "int", "default": 3600},
    "may_pause": {"type": "list", "elements": "str", "default": []},
}
PAUSE = 0.2


def watch(watcher: Watcher, end: Path, seconds: float) -> str:
    """Until the end; why the last look failed, if it did. A master that is replaced does not answer for a while."""
    deadline, why = time.monotonic() + seconds, ""
    while True:
        last = end.exists()
        try:
            watcher.look()
            why = ""
        except RosError as error:
            why = str(error)
        if last:
            return why
        if time.monotonic() > deadline:
            raise FleetError(f"{end} is not there after {seconds} s")
        time.sleep(PAUSE)


def main() -> None:
    module = AnsibleModule(argument_spec={**ROS_ARGS, **TRAFFIC_ARGS}, supports_check_mode=True)
    params = module.params
    try:
        watcher = Watcher(Ros1Client(params["master_uri"], params["node_timeout"]))
        why = watch(watcher, Path(params["end_file"]), params["seconds"])
    except FleetError as error:
        module.fail_json(msg=str(error), **error.details)
    result = watcher.result(params["may_pause"])
    result["problems"] += [f"the last look failed: {why}"] if why else []
    module.exit_json(changed=False, **result)


if __name__ == "__main__":
    main()
