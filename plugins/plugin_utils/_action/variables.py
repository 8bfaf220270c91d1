# SPDX-License-Identifier: GPL-3.0-or-later
"""A role's own variables, for the action plugins that belong to it: its argument spec says which, and of what type.

ansible.builtin.validate_argument_spec reads them the same way.
"""

from __future__ import annotations

import copy
from collections.abc import Collection, Mapping
from typing import Any

from ansible.module_utils.common.arg_spec import ArgumentSpecValidator

from ...module_utils._common.errors import SpecError
from .._model.role_specs import role_options

# How long a robot that works is waited for, and how many hosts may fail: the same for whatever is changed on a host.
OF_EVERY_CHANGE = ("update_on_busy", "update_busy_timeout", "update_failure_budget")


def role_variables(role: str, names: Collection[str], templar: Any, task_vars: Mapping[str, Any]) -> dict[str, Any]:
    """Variables of the role, all of them or these, templated and of their specs' types; SpecError names all others."""
    whole = role_options(role)
    # Ansible's validator writes into the defaults
    options = copy.deepcopy({name: whole[name] for name in names or whole})
    given = plain(templar.template({name: task_vars[name] for name in options if name in task_vars}))
    # a survey's question without an answer is null
    checked = ArgumentSpecValidator(options).validate({name: said for name, said in given.items() if said is not None})
    if checked.error_messages:
        raise SpecError(f"variables of the role {role}: {'; '.join(checked.error_messages)}")
    return dict(checked.validated_parameters)


def plain(value: Any) -> Any:
    """The value without the tags that Ansible's texts and numbers carry, which a YAML dumper does not know."""
    if isinstance(value, Mapping):
        return {plain(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    for kind in (bool, str, int, float):
        if isinstance(value, kind):
            return kind(value)
    return value
