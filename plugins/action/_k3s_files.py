# SPDX-License-Identifier: GPL-3.0-or-later
"""For the role k3s: write the tokens, and write and delete the files of the configuration that its plan names."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import ClassVar

from ..module_utils._common.documents import Arguments, Result, Variables
from ..module_utils._host.k3s import CONFIG_DIR
from ..plugin_utils._action.base import FleetAction
from ..plugin_utils._action.host import ActionHost
from ..plugin_utils._action.variables import plain, role_variables
from ..plugin_utils._k3s.source import tokens_to_keep
from ..plugin_utils._k3s.wanted import HostFile, wanted

PATHS = {"type": "list", "elements": "path", "required": True}


class ActionModule(FleetAction):
    """What may hold passwords is written without a diff.

    `registered` names the variable with what slurp read of the tokens on the first server, where it does not exist.
    With `staged` (an ending) what is to be written lies beside its place until somebody exchanges it, and nothing is
    deleted. The diff is against what is there.
    """

    TRANSFERS_FILES = True
    ARGUMENTS: ClassVar = {
        "tokens": {"type": "list", "elements": "str", "default": []},
        "registered": {"type": "str", "required": True},
        "write": PATHS,
        "remove": PATHS,
        "joins": {"type": "str", "default": ""},
        "etcd": {"type": "bool", "default": False},
        "staged": {"type": "str", "default": ""},
    }

    def work(self, params: Arguments, known: Variables) -> Result:
        check, variables = self._task.check_mode, role_variables("k3s", self._templar, known)
        # where it is staged, its place is looked at only
        host = ActionHost(self, known, check_mode=check or bool(params["staged"]))
        joins, etcd = plain(params["joins"]), params["etcd"]
        files = wanted(variables, known["inventory_hostname"], known["hostvars"], joins, etcd).files
        result = {"changed": False, "diff": [], "written": params["write"], "removed": params["remove"]}
        read = plain(self._templar.template(known.get(params["registered"], {}))).get("results", [])
        texts = tokens_to_keep(params["tokens"], read, variables)
        tokens = ActionHost(self, known, check_mode=check)
        done = [tokens.write(f"{CONFIG_DIR}/{name}", f"{text}\n", "0600", diff=False) for name, text in texts.items()]
        done += [
            host.write(file.path, file.content, file.mode, diff=self._task.diff and not file.secret)
            for file in files
            if file.path in params["write"]
        ]
        done += [host.module("ansible.builtin.file", {"path": path, "state": "absent"}) for path in params["remove"]]
        for one in [*done, *self._stage(files, params, known)]:
            if one.get("failed"):
                return {**result, "failed": True, "msg": one.get("msg", "a file could not be written")}
            diffs = one.get("diff") or []
            result["diff"] += diffs if isinstance(diffs, list) else [diffs]
            result["changed"] |= bool(one.get("changed"))
        return result

    def _stage(self, files: Sequence[HostFile], params: Arguments, known: Variables) -> Iterator[Result]:
        host = ActionHost(self, known)
        for file in files:
            if params["staged"] and file.path in params["write"] and not self._task.check_mode:
                yield host.write(file.path + params["staged"], file.content, file.mode, diff=False)
