# SPDX-License-Identifier: GPL-3.0-or-later
"""One kind of error for everything that the user can mend."""

from __future__ import annotations


class LabError(Exception):
    """What went wrong, with where it was seen and what to do about it."""

    def __init__(self, what: str, where: str = "", todo: str = "") -> None:
        lines = [what]
        if where:
            lines.append(f"  where: {where}")
        if todo:
            lines.append(f"  do:    {todo}")
        super().__init__("\n".join(lines))
