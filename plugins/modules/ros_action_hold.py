#!/usr/bin/python
# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
from __future__ import annotations

DOCUMENTATION = r"""
module: ros_action_hold
short_description: Hold back new goals of idle ROS 1 actions, and let them go
version_added: 1.0.0
description:
  - Waits until actions (actionlib) are idle, has the robot's keeper hold back the goals that come from then on, and
    looks once more. A goal that came in between is left to finish, and what was held goes to the server; then it waits
    again.
  - So an action server can be replaced after it without a goal being aborted. With O(values) it waits for what messages
    say, too, and holds nothing before.
  - The keeper lets go by itself, to a new server when one is up, or to the old one after O(seconds). Nothing more has
    to be done for that, so a control node that dies after this leaves nothing behind.
extends_documentation_fragment:
  - rosops.fleet._ros
  - rosops.fleet._ros.values
options:
  state:
    description:
      - With V(held), goals are held once all of O(actions) are idle.
      - With V(released), goals that are held go to whatever server there is.
    type: str
    choices: [held, released]
    default: held
  actions:
    description: Actions that must be idle, with their full names.
    type: list
    elements: dict
    required: true
    suboptions:
      name:
        description: Name of the action, the part before C(/goal) and C(/status).
        type: str
        required: true
      server:
        description: Node that serves the action now. Goals are held only where it is given.
        type: str
  keeper_uri:
    description:
      - URI of the keeper, C(http://<address of the Service ros-keeper>:11411). Without one nothing is held, and the
        module only waits until the actions are idle.
    type: str
  seconds:
    description:
      - Seconds after which the keeper lets go, to the old server, if no new one came.
      - With V(0) nothing is held, and one look that finds the actions idle is enough.
    type: float
    default: 60.0
  timeout:
    description:
      - Seconds until the actions have to be idle. With V(0) it is looked twice.
      - With O(state=released), seconds for which a keeper that is away is asked again.
    type: float
    default: 60.0
  interval:
    description: Seconds from the start of a look to the start of the next.
    type: float
    default: 0.2
attributes:
  check_mode:
    description: Looks once whether the actions are idle; holds and releases nothing.
    support: full
  diff_mode:
    description: What is held is no state that a file or an object shows.
    support: none
  idempotent:
    description: Goals that are held already are held on; what is not held needs no release.
    support: full
seealso:
  - module: rosops.fleet.ros_ready
author: rosops.fleet contributors (@rosops)
"""

EXAMPLES = r"""
- name: The arm has finished, and whoever wants something of it waits
  rosops.fleet.ros_action_hold:
    master_uri: http://10.43.0.17:11311
    keeper_uri: http://10.43.0.18:11411
    actions:
      - {name: /arm/move, server: /arm_1f0c2a9b}
    timeout: 300

- name: The arm stays as it is after all
  rosops.fleet.ros_action_hold:
    master_uri: http://10.43.0.17:11311
    keeper_uri: http://10.43.0.18:11411
    state: released
    actions:
      - name: /arm/move
"""

RETURN = r"""
verdict:
  description: V(pass); V(wait) where an action was still busy when the time was over; V(fail).
  returned: always
  type: str
  sample: pass
reason:
  description:
    - What the last look saw of the actions that are not idle and of messages that say something else, or what keeps it
      from being seen.
    - Of goals that cannot be held, why. That is a warning, too, and no failure.
  returned: always
  type: str
  sample: "action /arm/move: 1 goal active"
held:
  description: Actions whose goals are held now.
  returned: always
  type: list
  elements: str
  sample: [/arm/move]
called_off:
  description: How often goals were held and let go again, because one had come before.
  returned: with O(state=held)
  type: int
elapsed:
  description: Seconds that it took.
  returned: always
  type: float
"""

from functools import partial

from ansible.module_utils.basic import AnsibleModule

from ..module_utils._common.documents import Data
from ..module_utils._common.errors import FleetError, RosError
from ..module_utils._common.poll import FAIL, PASS, WAIT, Seen, poll
from ..module_utils._ros.client import ROS_ARGS, Ros1Client
from ..module_utils._ros.conditions import VALUE_ARGS, conditions_from
from ..module_utils._ros.idle_hold import CONSECUTIVE, Held, hold_when_idle
from ..module_utils._ros.idle_robot import IdleRobot, at_once, reason_of
from ..module_utils._ros.keeper_client import KeeperCalls

CALLER = "/rosops_fleet_step"
HOLD_ARGS: dict[str, Data] = {
    "state": {"type": "str", "choices": ["held", "released"], "default": "held"},
    "actions": {
        "type": "list",
        "elements": "dict",
        "required": True,
        "options": {"name": {"type": "str", "required": True}, "server": {"type": "str"}},
    },
    "keeper_uri": {"type": "str"},
    "seconds": {"type": "float", "default": 60.0},
    "timeout": {"type": "float", "default": 60.0},
    "interval": {"type": "float", "default": 0.2},
}


def release(keeper: KeeperCalls, actions: list[str], params: Data, check_mode: bool) -> Data:
    """Let go what is held of the actions. A keeper that is away is asked again until the time is over."""
    there: set[str] = set()

    def probe() -> Seen:
        try:
            there.update(keeper.held().keys() & set(actions))
        except (FleetError, OSError) as error:
            return Seen(WAIT, str(error))
        calls = {} if check_mode else {name: partial(keeper.release, name) for name in sorted(there)}
        problems = [why for why in at_once(calls).values() if why]
        return Seen(WAIT if problems else PASS, "; ".join(problems))

    ended = poll(probe, params["timeout"], params["interval"])
    if ended.verdict != PASS:
        raise RosError(ended.last, held=sorted(there))
    return {"changed": bool(there), "verdict": PASS, "reason": "", "held": [], "elapsed": round(ended.elapsed, 3)}


def result_of(ended: Held) -> Data:
    """What the module returns of a hold."""
    return {
        "changed": bool(ended.held),
        "verdict": ended.verdict,
        "reason": reason_of(ended),
        "held": list(ended.held),
        "called_off": ended.called_off,
        "elapsed": round(ended.elapsed, 3),
    }


def main() -> None:
    module = AnsibleModule(
        argument_spec={**ROS_ARGS, **HOLD_ARGS, **VALUE_ARGS},
        required_if=[("state", "released", ["keeper_uri"])],
        supports_check_mode=True,
    )
    params = module.params
    names = [action["name"] for action in params["actions"]]
    servers = {action["name"]: action["server"] for action in params["actions"] if action["server"]}
    try:
        if params["state"] == "released":
            result = release(KeeperCalls(params["keeper_uri"], CALLER), names, params, module.check_mode)
        else:
            idle = [{**action, "state": "idle"} for action in params["actions"]]
            # of a wait in several calls, one may be shorter than what has to be quiet
            wanted = {**params, "actions": idle, "timeout": None}
            ros = Ros1Client(params["master_uri"], params["node_timeout"], CALLER)
            keeper = KeeperCalls(params["keeper_uri"] or "", CALLER)
            robot = IdleRobot(ros, keeper, conditions_from(wanted), lambda: params["seconds"])
            only_look = module.check_mode or not (params["keeper_uri"] and params["seconds"])
            looks = CONSECUTIVE if params["seconds"] else 1
            ended = hold_when_idle(robot, {} if only_look else servers, params["timeout"], params["interval"], looks)
            for problem in ended.problems:
                module.warn(problem)
            result = result_of(ended)
    except (FleetError, OSError) as error:
        details = error.details if isinstance(error, FleetError) else {}
        module.fail_json(**{"msg": str(error), "verdict": FAIL, "reason": str(error), "held": [], **details})
    if result["verdict"] == FAIL:
        module.fail_json(msg=f"It cannot be seen whether the robot is idle: {result['reason']}", **result)
    module.exit_json(**result)


if __name__ == "__main__":
    main()
