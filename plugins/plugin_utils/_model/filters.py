# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What all filters share: errors of the collection become errors of Ansible."""

from __future__ import annotations

import functools
from typing import Any, Callable

from ansible.errors import AnsibleFilterError
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import FleetError


def filter_module(**functions: Callable[..., Any]) -> dict[str, Callable[..., Any]]:
    """The functions by their filter names, each failing the way Ansible reports best."""
    return {name: _guarded(name, function) for name, function in functions.items()}


def _guarded(name: str, function: Callable[..., Any]) -> Callable[..., Any]:
    @functools.wraps(function)
    def call(*args: Any, **kwargs: Any) -> Any:
        try:
            return function(*args, **kwargs)
        except FleetError as error:
            raise AnsibleFilterError(f"rosops.fleet.{name}: {error}") from None
        except (AttributeError, KeyError, TypeError, ValueError) as error:
            # a shape that fleet_config would have reported: say which filter met it instead of a bare traceback
            raise AnsibleFilterError(
                f"rosops.fleet.{name}: the input is not shaped as documented ({type(error).__name__}); "
                "run the tag `validate`, which says where"
            ) from error

    return call
