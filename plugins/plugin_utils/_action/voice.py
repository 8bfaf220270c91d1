# SPDX-License-Identifier: GPL-3.0-or-later
"""What a task says while it goes on."""

from __future__ import annotations

import contextlib
import threading
from pathlib import Path

from ansible import constants as C  # noqa: N812 - its customary name
from ansible.utils.display import Display

from ...module_utils._common.errors import printable
from .._update.ledger import Standing

display = Display()
_ALONE = threading.Lock()


def show(text: str) -> None:
    """Print it as it is."""
    with _ALONE:
        display.display(text)


def say(host: str, text: str) -> None:
    """Print it. Only its first line begins with the host's name."""
    show(f"[{host}] " + printable(text).replace("\n", "\n  "))
    _note(host)


def stand(host: str, text: str) -> None:
    """Where the task stands: printed with `-v`, else where the run was silent for long."""
    display.v(f"[{host}] {printable(text)}")
    _note(host, printable(text))


def _note(host: str, text: str = "") -> None:
    with contextlib.suppress(OSError):  # a full disk, say: what is told is more than where it stands
        Standing(Path(C.DEFAULT_LOCAL_TMP)).note(host, text)
