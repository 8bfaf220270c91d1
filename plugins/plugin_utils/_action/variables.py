# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""A role's own variables, for the action plugins that belong to it: its argument spec says which, and of what type.

ansible.builtin.validate_argument_spec reads them the same way.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping
from typing import Any

from ansible.module_utils.common.arg_spec import ArgumentSpecValidator
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.role_specs import role_options


def role_variables(role: str, templar: Any, task_vars: Mapping[str, Any]) -> dict[str, Any]:
    """Every variable of the role by its name, templated, of its spec's type; SpecError names all that have another."""
    options = copy.deepcopy(role_options(role))  # Ansible's validator writes into the defaults
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
