# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""One line of a host's report: what is wrong, where that was seen and what to do."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

ERROR = "error"
WARNING = "warning"


class Finding(NamedTuple):
    """An error stops the host, a warning does not."""

    severity: str
    what: str
    where: str
    fix: str


error, warning = partial(Finding, ERROR), partial(Finding, WARNING)
