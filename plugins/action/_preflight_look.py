# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""For the role preflight: the facts of this host, with the ports that its part in the cluster makes it need."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ansible_collections.rosops.fleet.plugins.plugin_utils._action.base import FleetAction
from ansible_collections.rosops.fleet.plugins.plugin_utils._action.host import ActionHost
from ansible_collections.rosops.fleet.plugins.plugin_utils._action.variables import role_variables
from ansible_collections.rosops.fleet.plugins.plugin_utils._preflight.requirements import look, server_addresses


class ActionModule(FleetAction):
    def work(self, _params: Mapping[str, Any], known: dict[str, Any]) -> dict[str, Any]:
        variables = role_variables("preflight", self._templar, known)
        servers = server_addresses(variables, known["inventory_hostname"], known["hostvars"])
        return ActionHost(self, known).action("rosops.fleet.preflight_info", look(variables, servers))
