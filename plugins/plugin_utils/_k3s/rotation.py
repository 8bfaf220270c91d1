# SPDX-License-Identifier: GPL-3.0-or-later
"""What a rotation has made of a host's certificates: names and ends, and nothing else of them. Pure."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from datetime import date, datetime

from ...module_utils._common.errors import NotReadyError, SpecError

Life = tuple[datetime, datetime]  # when it ended before the change, and when it ends now
FORM = "%Y-%m-%dT%H:%M:%S"
NODE = "agent/client-kubelet.crt"
NAME = re.compile(r"[a-z0-9]+([./-][a-z0-9]+)*")


def lives(found: Mapping[str, Sequence[str]]) -> dict[str, Life]:
    """Certificate -> its ends, as the host says them; SpecError for what is nothing of the kind."""
    try:
        return {name: _life(*ends) for name, ends in found.items() if NAME.fullmatch(name)}
    except (AttributeError, TypeError, ValueError) as error:
        raise SpecError("the host says of its certificates what makes no sense") from error


def _life(before: str, now: str) -> Life:
    return datetime.strptime(before, FORM), datetime.strptime(now, FORM)


def renewed(certificates: Mapping[str, Life]) -> dict[str, Life]:
    """Those that end later now; NotReadyError where that of the node is none of them."""
    later = {name: ends for name, ends in certificates.items() if ends[1] > ends[0]}
    if NODE not in later:
        raise NotReadyError(f"{NODE} is no other one than before, or ends no later")
    return later


def told(certificates: Mapping[str, Life]) -> str:
    """`until 2027-11-26 (before: 2027-03-01): agent/client-kubelet.crt, ...`."""
    alike: dict[tuple[date, date], list[str]] = {}
    for name, (before, now) in sorted(certificates.items()):
        alike.setdefault((now.date(), before.date()), []).append(name)
    return "; ".join(
        f"until {now}{f' (before: {before})' if now != before else ''}: {', '.join(names)}"
        for (now, before), names in sorted(alike.items())
    )
