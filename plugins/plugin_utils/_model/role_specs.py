# SPDX-License-Identifier: GPL-3.0-or-later
"""The roles' argument specs, which are the only table of their variables."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ansible.module_utils.common.yaml import yaml_load

from ...module_utils._common.documents import Arguments

Option = Arguments  # of a role, or what a mapping of it may hold
# By the place of the code and not of the play: playbooks of somebody else validate, too.
ROLES = Path(__file__).resolve().parents[3] / "roles"


@functools.cache
def role_options(role: str) -> Mapping[str, Option]:
    """The options of all entry points of a role, by variable."""
    text = (ROLES / role / "meta" / "argument_specs.yml").read_text("utf-8")
    entries = yaml_load(text)["argument_specs"].values()
    return {name: option for entry in entries for name, option in (entry.get("options") or {}).items()}


def completed(option: Option, value: Any) -> Any:
    """The value of an option, with the defaults of what a mapping leaves out; None for what has none."""
    if "options" not in option or option.get("type") != "dict":
        return option.get("default") if value is None else value
    return {name: completed(inner, (value or {}).get(name)) for name, inner in option["options"].items()}


def all_options() -> dict[str, Option]:
    """The options of all roles, by variable."""
    return {name: option for role in sorted(ROLES.glob("*/")) for name, option in role_options(role.name).items()}
