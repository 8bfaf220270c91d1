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
from ..plugin_utils._validate.fleet import check_fleet, lines
from ..plugin_utils._validate.hosts import archive_problems, image_warnings


class ActionModule(FleetAction):
    _requires_connection = False

    def work(self, _params: Arguments, known: Variables) -> Result:
        groups = {str(name): [str(host) for host in hosts] for name, hosts in known["groups"].items()}
        found = check_fleet(groups, HostVariables(known["hostvars"]), load_extra_vars(self._loader))
        fleet, wrong = found.fleet, [*archive_problems(found.hosts, unusable)]
        if fleet is None or wrong:
            told = lines([*found.problems, *wrong], found.hosts)
            words = f"{len(told)} error{'s' if len(told) > 1 else ''} in the fleet's variables:"
            failed = {"failed": True, "msg": "\n".join([words, *told])}
            return {"changed": False, "warnings": lines(found.warnings, found.hosts), **failed}
        remote = {image for robot in fleet.robots.values() for image in images(robot, "remote")}
        return {
            "changed": False,
            "warnings": lines([*found.warnings, *image_warnings(fleet, found.hosts, archived_instead)], found.hosts),
            **fleet.as_dict(),
            "remote_images": sorted(remote),
            "shared": any(needs_fleet_namespace(robot) for robot in fleet.robots.values()),
            # its apps' secrets are in it, and AWX keeps what callbacks are told of a task, at any verbosity
            **HIDDEN,
        }
