# SPDX-License-Identifier: GPL-3.0-or-later
"""For the playbook awx_setup: an object of AWX as data has it. Ansible warns where a task takes all its options so."""

from __future__ import annotations

from typing import ClassVar

from ..module_utils._common.documents import Arguments, Result, Variables
from ..plugin_utils._action.base import FleetAction


class ActionModule(FleetAction):
    """`object` are the options of awx.awx's module `kind`."""

    ARGUMENTS: ClassVar = {"kind": {"type": "str", "required": True}, "object": {"type": "dict", "required": True}}

    def work(self, params: Arguments, known: Variables) -> Result:
        name, options = f"awx.awx.{params['kind']}", dict(params["object"])
        return dict(self._execute_module(module_name=name, module_args=options, task_vars=known))
