# SPDX-License-Identifier: GPL-3.0-or-later
"""What a task says while it goes on."""

from __future__ import annotations

import contextlib
import io
import multiprocessing
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
    with _ALONE, _own_stdout():
        display.display(text)


def say(host: str, text: str) -> None:
    """Print it. Only its first line begins with the host's name."""
    show(f"[{host}] " + printable(text).replace("\n", "\n  "))
    _note(host)


def stand(host: str, text: str) -> None:
    """Where the task stands: printed with `-v`, else where the run was silent for long."""
    display.v(f"[{host}] {printable(text)}")
    _note(host, printable(text))


def _own_stdout() -> contextlib.AbstractContextManager[object]:
    """A worker hands its lines to the main process, which prints them.

    AWX's callback (`awx_display` of ansible-runner before 2.4.1) writes marks around them all the same, to what is the
    worker's own stdout; ansible-core finds them there and warns of it.
    """
    worker = multiprocessing.parent_process() is not None
    return contextlib.redirect_stdout(io.StringIO()) if worker else contextlib.nullcontext()


def _note(host: str, text: str = "") -> None:
    with contextlib.suppress(OSError):  # a full disk, say: what is told is more than where it stands
        Standing(Path(C.DEFAULT_LOCAL_TMP)).note(host, text)
