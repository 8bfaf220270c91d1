# SPDX-License-Identifier: GPL-3.0-or-later
"""What the collection's action plugins share: their options are checked, and our errors fail the task."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from typing import Any, ClassVar

from ansible.plugins.action import ActionBase

from ...module_utils._common.documents import Arguments, Result, Variables
from ...module_utils._common.errors import FleetError
from . import voice
from .variables import plain, role_variables


class FleetAction(ActionBase):  # type: ignore[misc] # ansible-core carries no types
    """An action whose options are ARGUMENTS. `work` does it; what it raises of ours is the task's failure."""

    ACCESS: ClassVar[Mapping[str, Any]] = {}  # options of a kind of action
    ARGUMENTS: ClassVar[dict[str, Any]] = {}

    def run(self, tmp: str | None = None, task_vars: dict[str, Any] | None = None) -> dict[str, Any]:
        result: dict[str, Any] = super().run(tmp, task_vars)
        params = plain(self.validate_argument_spec(argument_spec={**self.ACCESS, **self.ARGUMENTS})[1])
        try:
            return {**result, **self.perform(params, task_vars or {})}
        except FleetError as error:
            return {**result, "failed": True, "msg": str(error), **error.details}

    def perform(self, params: Arguments, known: Variables) -> Result:
        """`work`, with what a kind of action has around it."""
        return self.work(params, known)

    def work(self, params: Arguments, known: Variables) -> Result:
        """The task's result. `params` are its options, `known` the host's variables."""
        raise NotImplementedError

    def variables(self, known: Variables, role: str, *names: str) -> Result:
        """The host's variables of a role, all of them or these, of the types that its argument spec says."""
        return role_variables(role, names, self._templar, known)

    def say(self, known: Variables) -> Callable[[str], None]:
        """What prints a line while the task goes on."""
        return functools.partial(voice.say, known.get("inventory_hostname", ""))
