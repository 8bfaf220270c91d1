# SPDX-License-Identifier: GPL-3.0-or-later
"""For the role k3s: write the tokens, and write and delete the files of the configuration that its plan names."""

from __future__ import annotations

from typing import ClassVar

from ..module_utils._common.documents import Arguments, Result, Variables
from ..module_utils._host.k3s import CONFIG_DIR
from ..plugin_utils._action.base import FleetAction
from ..plugin_utils._action.host import ActionHost
from ..plugin_utils._action.variables import plain
from ..plugin_utils._k3s.source import tokens_to_keep
from ..plugin_utils._k3s.wanted import wanted


class ActionModule(FleetAction):
    """`plan` is what _k3s_plan found. What may hold passwords is written without a diff.

    `registered` names the variable with what slurp read of the tokens on the first server, where it does not exist.
    What is `staged` (an ending) lies beside its place until somebody exchanges it, and nothing is deleted. The diff is
    against what is there.
    """

    TRANSFERS_FILES = True
    ARGUMENTS: ClassVar = {"plan": {"type": "dict", "required": True}, "registered": {"type": "str", "required": True}}

    def work(self, params: Arguments, known: Variables) -> Result:
        check, variables, plan = self._task.check_mode, self.variables(known, "k3s"), plain(params["plan"])
        host, staged = ActionHost(self, known, check_mode=check), plan["staged"]
        # where it is staged, its place is looked at only
        place = ActionHost(self, known, check_mode=check or bool(staged))
        files = wanted(variables, known["inventory_hostname"], known["hostvars"], plan["joins"], plan["etcd"]).files
        result = {"changed": False, "diff": [], "written": plan["write"], "removed": plan["remove"]}
        read = plain(self._templar.template(known.get(params["registered"], {}))).get("results", [])
        texts = tokens_to_keep(plan["tokens"], read, variables)
        done = [host.write(f"{CONFIG_DIR}/{name}", f"{text}\n", "0600", diff=False) for name, text in texts.items()]
        for file in (file for file in files if file.path in plan["write"]):
            done.append(place.write(file.path, file.content, file.mode, diff=self._task.diff and not file.secret))
            if staged and not check:
                done.append(host.write(file.path + staged, file.content, file.mode, diff=False))
        done += [place.module("ansible.builtin.file", {"path": path, "state": "absent"}) for path in plan["remove"]]
        for one in done:
            if one.get("failed"):
                return {**result, "failed": True, "msg": one.get("msg", "a file could not be written")}
            diffs = one.get("diff") or []
            result["diff"] += diffs if isinstance(diffs, list) else [diffs]
            result["changed"] |= bool(one.get("changed"))
        return result
