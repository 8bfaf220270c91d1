# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What can be known of an image before a node has it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol


class Contents(Protocol):
    """What the archive of an image shows, on the control node. It is read when it is asked for."""

    @property
    def archive(self) -> str:
        """The archive's path."""

    @property
    def entrypoint(self) -> tuple[str, ...]:
        """What it runs by itself; `command` in a pod replaces it."""

    @property
    def cmd(self) -> tuple[str, ...]:
        """The arguments of that, or all of it where there is no entry point; `args` in a pod replace it."""

    @property
    def python(self) -> str | None:
        """The version of its `python3`, as `3.8`; empty where it has none, None where that is not seen."""


# The paths of archives, and the name of an image -> what it has; None where none of them shows it.
Find = Callable[[Sequence[str], str], Contents | None]


def unseen(_paths: Sequence[str], _image: str) -> None:
    """A control node that has no archive."""
