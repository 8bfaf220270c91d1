# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""A connection to the master over which nothing is said: it ends with the master's process, which is noticed at once.

So the keeper need not ask once a second whether the master is still the same. A master that hangs up on whoever says
nothing (`roscore -t 2`: after two seconds) is connected to again: where that fails, it has ended. A host that loses its
power closes no connection; whoever holds this still has to look now and then.
"""

from __future__ import annotations

import contextlib
import socket
import threading
import time
from typing import Callable

AT_ONCE = 0.5  # seconds for a connection, which takes milliseconds: one that waits has lost the master meanwhile
LEAST = 1.0  # seconds between connections: one that hangs up at once would be connected to all the time


class Lifeline:
    """`wake` is called, in a thread of its own, when the master has ended."""

    def __init__(self, address: tuple[str, int], wake: Callable[[], None]) -> None:
        self.address, self.wake = address, wake
        self.stands = False
        self._thread: threading.Thread | None = None

    def hold(self) -> bool:
        """Whether it stands now; where not, it is begun anew beside the caller."""
        if self._thread is None or not self._thread.is_alive():
            self._thread = threading.Thread(target=self._run, daemon=True)
            self._thread.start()
        return self.stands

    def _run(self) -> None:
        try:
            while True:
                time.sleep(self._connection())
        except OSError:
            if self.stands:
                self.wake()
        finally:
            self.stands = False

    def _connection(self) -> float:
        """One, until it ends; seconds to wait for another one. OSError: there was none."""
        with socket.create_connection(self.address, AT_ONCE) as sock:
            began = time.monotonic()
            sock.settimeout(None)
            self.stands = True
            with contextlib.suppress(OSError):
                sock.recv(1)
        return max(0.0, LEAST - (time.monotonic() - began))
