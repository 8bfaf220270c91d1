# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The filter rosops.fleet.listed."""

from __future__ import annotations

DOCUMENTATION = """
name: listed
short_description: A list, also where it was given as text
version_added: 1.0.0
author: rosops.fleet contributors (@rosops)
description:
  - Answers of an AWX survey and values that C(-e name=value) gives are text. This makes the list of it that was meant.
  - An empty text is an empty list.
positional: _input
options:
  _input:
    description: A list; or the text of one in YAML or JSON; or words with commas, blanks or lines between them.
    type: raw
    required: true
"""

EXAMPLES = """
- name: Waves from a survey
  ansible.builtin.debug:
    msg: "{{ '1, 25%, 100%' | rosops.fleet.listed }}"
"""

RETURN = """
_value:
  description: The list.
  type: list
  elements: raw
"""

from collections.abc import Callable
from typing import Any

from ansible.errors import AnsibleFilterError

from ..module_utils._common.errors import SpecError
from ..plugin_utils._model import formats


def _listed(value: Any) -> list[Any]:
    try:
        return formats.listed(value)
    except SpecError as error:
        raise AnsibleFilterError(str(error)) from error


class FilterModule:
    """What Ansible looks for."""

    def filters(self) -> dict[str, Callable[[Any], list[Any]]]:
        return {"listed": _listed}
