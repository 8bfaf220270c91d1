# SPDX-License-Identifier: GPL-3.0-or-later
"""For the playbook validate: the whole inventory, in this process: hosts' variables are read where Ansible has them."""

from __future__ import annotations

from ansible.utils.vars import load_extra_vars

from ..module_utils._common.documents import Arguments, Result, Variables
from ..plugin_utils._action.base import FleetAction
from ..plugin_utils._images.archive import archived_instead, unusable
from ..plugin_utils._model.host_variables import HostVariables
from ..plugin_utils._objects.namespace import needs_fleet_namespace
from ..plugin_utils._objects.parts import images
from ..plugin_utils._upstream.ansible_core import HIDDEN
from ..plugin_utils._validate.fleet import Report, check_fleet, folded
from ..plugin_utils._validate.hosts import archive_problems, image_warnings


class ActionModule(FleetAction):
    _requires_connection = False

    def work(self, _params: Arguments, known: Variables) -> Result:
        groups = {str(name): [str(host) for host in hosts] for name, hosts in known["groups"].items()}
        found = check_fleet(groups, HostVariables(known["hostvars"]), load_extra_vars(self._loader))
        wrong = [*archive_problems(found.hosts, unusable)]
        fleet = None if wrong else found.fleet
        seen = image_warnings(fleet, found.hosts, archived_instead) if fleet else ()
        return outcome(Report([*found.problems, *wrong], [*found.warnings, *seen], fleet, found.hosts))


def outcome(report: Report) -> Result:
    """What the task returns."""
    result: Result = {
        "changed": False,
        "warnings": [warning.line() for warning in folded(report.warnings, report.hosts)],
    }
    if report.fleet is not None:
        remote = {image for robot in report.fleet.robots.values() for image in images(robot, "remote")}
        shared = any(needs_fleet_namespace(robot) for robot in report.fleet.robots.values())
        whole = {**report.fleet.as_dict(), "remote_images": sorted(remote), "shared": shared}
        # its apps' secrets are in it, and AWX keeps what callbacks are told of a task, at any verbosity
        return {**result, **whole, **HIDDEN}
    lines = [problem.line() for problem in folded(report.problems, report.hosts)]
    words = f"{len(lines)} error{'s' if len(lines) > 1 else ''} in the fleet's variables:"
    return {**result, "failed": True, "msg": "\n".join([words, *lines])}
