# SPDX-License-Identifier: GPL-3.0-or-later
"""What a run made of a host, and the run's own note of that. The hosts' clusters keep it, too: `kept`."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from ansible import constants as C  # noqa: N812 - its customary name

from ...module_utils._common.documents import Data, Document
from .._model.keys import plain, read
from .._update.outcome import RobotOutcome
from .files import text_of, write

NOTE = "rosops-fleet-run.json"  # of the run at hand, in Ansible's temporary directory of it
# What somebody changed by hand, as it is read.
SPOILT = (ArithmeticError, AttributeError, LookupError, OSError, RecursionError, TypeError, ValueError)


@dataclass(frozen=True)
class HostRun:
    """What one run made of one host. `started` is in UTC; `changed` is how many tasks did."""

    host: str
    playbook: str
    started: str
    outcome: RobotOutcome
    changed: int = 0
    failed_task: str = ""

    def as_dict(self) -> Data:
        """As the cluster and the note have it."""
        return {**plain(self), **self.outcome.as_dict(), "failed_task": self.failed_task or None}

    @classmethod
    def from_dict(cls, told: Document) -> HostRun:
        """What `as_dict` made of it; raises one of SPOILT for what is of another shape."""
        host, playbook, started = (str(told[key]) for key in ("host", "playbook", "started"))
        changed, task = int(told.get("changed") or 0), str(told.get("failed_task") or "")
        return cls(host, playbook, started, RobotOutcome.from_dict(told), changed, task)


def note_of(reason: str, failed_task: str) -> str:
    """What there is to say of a host's outcome, in one line: the cause, and then where it showed."""
    first = " ".join(line.strip() for line in reason.strip().splitlines()[:2])
    return f"{first} (task: {failed_task})".strip() if failed_task else first


@dataclass(frozen=True)
class Noted:
    """What is known of a run at hand: what became of each host if it is still here, and if the run has lost it, as
    `HostRun.as_dict` has it."""

    playbook: str = ""
    started: str = ""
    here: Mapping[str, Data] = field(default_factory=dict)
    lost: Mapping[str, Data] = field(default_factory=dict)


def note_run(found: Noted) -> None:
    """Write down what is known of this run so far, for the tasks that come."""
    write(Path(C.DEFAULT_LOCAL_TMP) / NOTE, json.dumps(plain(found)))


def noted_run() -> Noted:
    """What was written down of this run; nothing where nobody does."""
    return read(Noted, json.loads(text_of(Path(C.DEFAULT_LOCAL_TMP) / NOTE) or "{}"))
