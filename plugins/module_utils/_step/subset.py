# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether an object of the API still says what was applied. Pure."""

from __future__ import annotations

from typing import Any, Mapping

IDENTITIES = ("name", "mountPath", "containerPort", "key")  # by which the API server knows the entries of a list


def is_in(wanted: Any, there: Any) -> bool:
    """Whether all that is wanted is there; what is there besides are defaults, or somebody else's."""
    if isinstance(wanted, Mapping):
        found = there if isinstance(there, Mapping) else {}
        return all(is_in(value, found.get(key)) for key, value in wanted.items())
    if isinstance(wanted, (list, tuple)):
        return _are_in(list(wanted), list(there or ()))
    return bool((there or None) == (wanted or None))  # what is empty is left out by the API server


def _are_in(wanted: list[Any], there: list[Any]) -> bool:
    known = next((key for key in IDENTITIES if all(isinstance(one, Mapping) and key in one for one in wanted)), "")
    if not (wanted and known):
        return len(wanted) == len(there) and all(map(is_in, wanted, there))
    found = {one.get(known): one for one in there}
    return all(is_in(one, found.get(one[known])) for one in wanted)
