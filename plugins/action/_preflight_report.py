# SPDX-License-Identifier: GPL-3.0-or-later
"""For the role preflight: all findings about this host at once, measured against the other hosts of the play."""

from __future__ import annotations

from typing import ClassVar

from ..module_utils._common.documents import Arguments, Result, Variables
from ..plugin_utils._action.base import FleetAction
from ..plugin_utils._preflight.findings import ERROR, PART, judge, report, server_addresses
from ..plugin_utils._upstream.ansible_core import SHOWN


class ActionModule(FleetAction):
    """`registered` names the variable in which every host keeps its own facts."""

    _requires_connection = False
    ARGUMENTS: ClassVar = {
        **PART,
        "registered": {"type": "str", "required": True},
        "node_name": {"type": "str", "required": True},
        "k3s_version": {"type": "str", "default": ""},
        "interface": {"type": "str", "default": ""},
    }

    def work(self, params: Arguments, known: Variables) -> Result:
        name, host, hostvars = params["registered"], known["inventory_hostname"], known["hostvars"]
        if "facts" not in hostvars[host][name]:
            return {"changed": False, "skipped": True, "msg": "it could not be reached"}
        others = server_addresses(params["servers"], host, hostvars)
        # every host of the play that answered: names and MTUs are compared across them
        looks = {other: hostvars[other][name] for other in known["ansible_play_hosts"]}
        fleet = {other: look["facts"] for other, look in looks.items() if "facts" in look}
        found = judge(fleet, host, {**self.variables(known, "preflight"), **params, "others": others})
        return {
            "changed": False,
            "failed": any(one.severity == ERROR for one in found),
            "msg": report(host, found).splitlines(),
            **SHOWN,
        }
