# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The roles' argument specs, which are the only table of their variables."""

from __future__ import annotations

import functools
from pathlib import Path
from typing import Any, Mapping

from ansible.module_utils.common.yaml import yaml_load
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError

Option = Mapping[str, Any]
# By the place of the code and not of the play: playbooks of somebody else validate, too.
ROLES = Path(__file__).resolve().parents[3] / "roles"


@functools.cache
def role_options() -> dict[str, Option]:
    """Variable -> its option in meta/argument_specs.yml, of all entry points of all roles."""
    found: dict[str, Option] = {}
    for path in sorted(ROLES.glob("*/meta/argument_specs.yml")):
        for entry in yaml_load(path.read_text("utf-8"))["argument_specs"].values():
            found.update(entry.get("options") or {})
    if not found:
        raise SpecError(f"the collection is not whole: there are no argument specs of its roles in {ROLES}")
    return found
