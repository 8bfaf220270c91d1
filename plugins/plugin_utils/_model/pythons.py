# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which Python this ansible-core wants on hosts. One that is older runs no module at all."""

from __future__ import annotations

import re
from collections.abc import Sequence

from ansible.module_utils.basic import _PY_MIN as OLDEST
from ansible.release import __version__

CORE = __version__

_NUMBERS = re.compile(r"(\d+)\D+(\d+)")


def too_old(text: str) -> str:
    """What is wrong where a host's Python is of the version that `text` begins with; empty where nothing is."""
    found = _NUMBERS.search(text)
    own = tuple(int(number) for number in found.groups()) if found else OLDEST
    if own >= OLDEST:
        return ""
    return (
        f"has Python {_dotted(own)}, and ansible-core {CORE} needs {_dotted(OLDEST)} or newer on hosts. Take an "
        "ansible-core that takes it (2.19 takes 3.8, which Ubuntu 20.04 has), or install a newer Python there and name "
        "it in ansible_python_interpreter"
    )


def _dotted(numbers: Sequence[int]) -> str:
    return ".".join(str(number) for number in numbers)
