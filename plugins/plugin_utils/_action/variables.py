# SPDX-License-Identifier: GPL-3.0-or-later
"""A role's own variables, for the action plugins that belong to it: its argument spec says which, and of what type.

ansible.builtin.validate_argument_spec reads them the same way.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping
from typing import Any

from ansible.module_utils.common.arg_spec import ArgumentSpecValidator

from ...module_utils._common.errors import SpecError
from .._model.role_specs import role_options

# How long a robot that works is waited for, and how many hosts may fail: the same for whatever is changed on a host.
OF_EVERY_CHANGE = ("update_on_busy", "update_busy_timeout", "update_failure_budget")


def change_variables(templar: Any, task_vars: Mapping[str, Any]) -> dict[str, Any]:
    """Those of the role update that count for every change of a host; as `role_variables`."""
    return _checked("update", {name: role_options("update")[name] for name in OF_EVERY_CHANGE}, templar, task_vars)


def role_variables(role: str, templar: Any, task_vars: Mapping[str, Any]) -> dict[str, Any]:
    """Every variable of the role by its name, templated, of its spec's type; SpecError names all that have another."""
    return _checked(role, role_options(role), templar, task_vars)


def _checked(role: str, given_options: Mapping[str, Any], templar: Any, task_vars: Mapping[str, Any]) -> dict[str, Any]:
    options = copy.deepcopy(dict(given_options))  # Ansible's validator writes into the defaults
    given = templar.template({name: task_vars[name] for name in options if name in task_vars})
    checked = ArgumentSpecValidator(options).validate(plain(given))
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
