# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Count open TCP connections of this network namespace. Pure. Runs on Python 3.8 with the standard library, in pods."""

from __future__ import annotations

from typing import Iterable

ESTABLISHED = "01"  # Linux, include/net/tcp_states.h


def established(tables: Iterable[str], ports: set[int]) -> int:
    """Connections that peers hold to one of our ports, in the text of /proc/net/tcp and /proc/net/tcp6.

    A row is `sl local_address rem_address st ...`, an address is `<hex>:<port in hex>`.
    """
    found = 0
    for table in tables:
        for row in table.splitlines()[1:]:
            fields = row.split()
            if len(fields) > 3 and fields[3] == ESTABLISHED and int(fields[1].rpartition(":")[2], 16) in ports:
                found += 1
    return found
