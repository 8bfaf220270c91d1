# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Types of the roles' public variables, so that a wrong one is reported before anything is touched.

Types only: the roles' own meta/argument_specs.yml says the rest, and tests/unit/test_role_specs.py compares the two.
"""

from __future__ import annotations

from typing import Any, Mapping

# The types of Ansible's argument specs as JSON Schema has them.
JSON_TYPES: dict[str, Mapping[str, Any]] = {
    "str": {"type": "string"},
    "path": {"type": "string"},
    "raw": {},
    "int": {"type": "integer"},
    "float": {"type": "number"},
    "bool": {"type": "boolean"},
    "list": {"type": "array"},
    "dict": {"type": "object"},
}

TYPES: dict[str, str] = {
    "k3s_token": "str",
}

ROLE_VARIABLES: dict[str, Mapping[str, Any]] = {name: JSON_TYPES[kind] for name, kind in TYPES.items()}
