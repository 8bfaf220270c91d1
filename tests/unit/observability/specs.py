# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""A stack's spec out of the few settings that a test is about; the others are the role's defaults."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ansible_collections.rosops.fleet.plugins.plugin_utils._model.role_specs import role_options
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability.spec import VARIABLES, spec_of


def full(settings: Mapping[str, Any]) -> dict[str, Any]:
    """`{"prometheus": {"size": "1Gi"}}` and the rest."""
    defaults = {name: option.get("default") for name, option in role_options("observability").items()}
    return spec_of({**defaults, **_variables(settings, VARIABLES)})


def _variables(settings: Mapping[str, Any], part: Mapping[str, Any]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for key, value in settings.items():
        if isinstance(part[key], str):
            found[f"observability_{part[key]}"] = value
        else:
            found |= _variables(value, part[key])
    return found
