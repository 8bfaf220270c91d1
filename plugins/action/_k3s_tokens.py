# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""For the role k3s: keep the tokens on the host, of which nothing is shown."""

from __future__ import annotations

from typing import ClassVar

from ..module_utils._common.documents import Arguments, Result, Variables
from ..module_utils._host.k3s import CONFIG_DIR
from ..plugin_utils._action.base import FleetAction
from ..plugin_utils._action.host import ActionHost
from ..plugin_utils._action.variables import plain, role_variables
from ..plugin_utils._k3s.tokens import tokens_to_keep


class ActionModule(FleetAction):
    """`registered` names the variable with what slurp read on the first server; on that server it does not exist."""

    TRANSFERS_FILES = True
    ARGUMENTS: ClassVar = {
        "names": {"type": "list", "elements": "str", "required": True},
        "registered": {"type": "str", "required": True},
    }

    def work(self, params: Arguments, known: Variables) -> Result:
        host = ActionHost(self, known, check_mode=self._task.check_mode)
        read = plain(self._templar.template(known.get(params["registered"], {}))).get("results", [])
        texts = tokens_to_keep(params["names"], read, role_variables("k3s", self._templar, known))
        changed = False
        for name, text in texts.items():
            one = host.write(f"{CONFIG_DIR}/{name}", f"{text}\n", "0600", diff=False)
            if one.get("failed"):
                return {
                    "failed": True,
                    "changed": changed,
                    "msg": f"{CONFIG_DIR}/{name} could not be written: {one.get('msg')}",
                }
            changed |= bool(one.get("changed"))
        return {"changed": changed}
