#!/usr/bin/python
# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Check a whole fleet's inventory before anything is touched."""

from __future__ import annotations

DOCUMENTATION = r"""
module: fleet_config
short_description: Check the whole fleet's variables before anything is touched
version_added: 0.1.0
author: rosops.fleet contributors (@rosops)
description:
  - Checks groups, robots, apps, volumes and masters of a fleet, one by one and against each other.
  - Reports all errors at once, each with the path of the value, what is wrong with it and what is allowed.
  - Looks at its input only. It contacts no host and no cluster and changes nothing.
options:
  fleet:
    description:
      - The inventory's groups and the fleet's variables of each host.
      - The filter P(rosops.fleet.fleet_hosts#filter) picks the variables and keeps secrets out.
    type: dict
    required: true
attributes:
  check_mode:
    description: Can run in check mode and return the same as without it.
    support: full
  diff_mode:
    description: Shows what has changed when in diff mode.
    support: N/A
requirements:
  - jsonschema (Python library, on the control node only)
seealso:
  - plugin: rosops.fleet.fleet_hosts
    plugin_type: filter
"""

EXAMPLES = r"""
- name: Check the inventory
  rosops.fleet.fleet_config:
    fleet:
      groups: "{{ groups }}"
      hosts: "{{ hostvars | rosops.fleet.fleet_hosts(groups.all) }}"
  delegate_to: localhost
  run_once: true

- name: Check a fleet that is written down here
  rosops.fleet.fleet_config:
    fleet:
      groups:
        edge: [edge1]
        robots: [robot1]
      hosts:
        robot1:
          ros_apps:
            - name: talker
              image: registry.example.org/talker:1.2.0
              args: [rosrun, rospy_tutorials, talker]
              placement: local
              pattern: pubsub
  delegate_to: localhost
  run_once: true
"""

RETURN = r"""
valid:
  description: Whether the fleet can be brought up as it is described. A module that finds errors fails.
  returned: always
  type: bool
errors:
  description: All errors.
  returned: always
  type: list
  elements: dict
  contains:
    path:
      description: The path of the value.
      type: str
      sample: hosts.robot1.ros_apps[2].placement
    problem:
      description: What is wrong.
      type: str
      sample: is 'cloud'
    allowed:
      description: What would be right.
      type: str
      sample: local or remote
notes:
  description: What is allowed but seldom meant; the module's warnings.
  returned: always
  type: list
  elements: str
robots:
  description: The robots with every default filled in, without secrets; empty if there are errors.
  returned: always
  type: dict
"""

import traceback

from ansible.module_utils.basic import AnsibleModule, missing_required_lib
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.secrets import redact
from ansible_collections.rosops.fleet.plugins.plugin_utils._validate.fleet import check_fleet

try:
    import jsonschema  # noqa: F401  # pylint: disable=unused-import  # the checks need it
except ImportError:
    JSONSCHEMA_ERROR: str | None = traceback.format_exc()
else:
    JSONSCHEMA_ERROR = None


def main() -> None:
    """Entry point."""
    module = AnsibleModule(argument_spec={"fleet": {"type": "dict", "required": True}}, supports_check_mode=True)
    if JSONSCHEMA_ERROR is not None:
        module.fail_json(msg=missing_required_lib("jsonschema"), exception=JSONSCHEMA_ERROR)
    # The invocation is part of every result: whoever calls without the filter must not see a token there.
    fleet = module.params["fleet"] = redact(module.params["fleet"], {})
    report = check_fleet(fleet)
    for warning in report.warnings:
        module.warn(warning)
    result = {
        "changed": False,
        "valid": not report.problems,
        "errors": [problem.as_dict() for problem in report.problems],
        "notes": report.warnings,
        "robots": report.robots,
    }
    if report.problems:
        count = len(report.problems)
        lines = "\n".join(problem.line() for problem in report.problems)
        module.fail_json(msg=f"{count} error{'s' if count > 1 else ''} in the fleet's variables:\n{lines}", **result)
    module.exit_json(**result)


if __name__ == "__main__":
    main()
