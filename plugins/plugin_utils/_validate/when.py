# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Checks of what messages must say before an update, as the module on the robot will make them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from ...module_utils._common.errors import SpecError
from ...module_utils._ros.conditions import conditions_from
from .._model.finding import Problem
from .said import Said

ALLOWED = "what ros_ready's option values takes (ansible-doc rosops.fleet.ros_ready)"


def when_problems(items: Sequence[Said], path: str) -> Iterator[Problem]:
    """Problems of items that passed the schema; `path` is where their list is."""
    try:
        conditions_from({"values": items})
    except SpecError as error:
        for line in error.details["errors"]:
            where, _colon, problem = line.partition(": ")
            yield Problem(path + where.removeprefix("values"), problem, ALLOWED)
