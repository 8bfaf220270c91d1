# SPDX-License-Identifier: GPL-3.0-or-later
"""What a step leaves beside each app that it changes, and the one answer to what the app's version is. Pure.

docs/updates.md, "The record decides, not the mark", says what is in the ConfigMap `<app>-update`, and what a mark is
worth. The record is written before the Deployment.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from typing import Any, Mapping, Sequence

from .._common.documents import json_of
from .._ros.contract import NOTHING, Contract
from .._ros.names import in_pods
from .objects import Object, annotations_of, name_of, revision_of
from .words import CONTRACT, HISTORY, SOAKING, UPDATING

# The answers.
INSTALLED = "installed"  # by an installation that has not proven it: no version before it was ever proven
PROVEN = "proven"
ON_TRIAL = "on trial"  # by a step that has not proven it, or has not taken it back yet
GOING_BACK = "going back"  # the version before, brought back and not yet proven again
UNKNOWN = "unknown"  # nobody has written down that it was brought: it may be at work
UNPROVEN = (INSTALLED, ON_TRIAL, GOING_BACK)

READY_TIMEOUT = 180.0  # seconds, where the record does not say it


def record_name(app: str) -> str:
    """Of the ConfigMap that keeps an app's contract and its earlier versions."""
    return f"{app}-update"


@dataclass(frozen=True)
class Mark:
    """What such an annotation of a Deployment says. Collections before 1.0 wrote the run alone."""

    run: str
    revision: str = ""

    def __str__(self) -> str:
        return f"{self.run} {self.revision}"


def mark_of(deployment: Object | None, key: str = UPDATING) -> Mark | None:
    """The mark that it carries, whatever that is worth."""
    text = annotations_of(deployment).get(key)
    if text is None:
        return None
    run, _space, revision = text.partition(" ")
    return Mark(run, revision)


@dataclass(frozen=True)
class Record:
    """`contract` is what the revision owes, `history` earlier versions that were proven, the last one first.

    `run` is which run wrote it (empty: a collection before 1.0), `apps` are those of its step, in the step's order.
    `watch`: seconds for which the keeper is to watch the version, which its run has found good; `ends`: how many of its
    containers' lives had ended by then. `ignore`: what the inventory lets any next version lack, as `Intended` has it.
    """

    contract: Contract = NOTHING
    history: Sequence[dict[str, Any]] = ()
    run: str = ""
    apps: tuple[str, ...] = ()
    proven: bool = False
    ready_timeout: float = READY_TIMEOUT
    watch: float = 0.0
    ends: int = 0
    ignore: tuple[str, ...] = ()

    @property
    def revision(self) -> str:
        return self.contract.revision

    @property
    def soak(self) -> float:
        """Seconds for which the version soaks, since its run has found it good; 0: it does not."""
        return 0.0 if self.proven else self.watch

    @property
    def before(self) -> Object | None:
        """The Deployment to go back to; None: there is none."""
        found: Object | None = self.history[0]["deployment"] if self.history else None
        return found

    def is_history(self, revision: str) -> bool:
        """Whether that is one of the versions that were proven before."""
        return any(entry.get("revision") == revision for entry in self.history)

    def is_by(self, mark: Mark | None, revision: str) -> bool:
        """Whether its step put the mark on just this revision."""
        return mark is not None and (not self.run or mark.run == self.run) and mark.revision in ("", revision)

    def fulfilled(self) -> Record:
        """Once its revision is proven."""
        return replace(self, proven=True)

    def found_good(self, soak: float, ends: int, templates: Mapping[str, str]) -> Record:
        """Once its run has seen that it fulfils its contract, and leaves it to the keeper to prove it.

        `templates`: revision -> its pods' hash. Keepers that run since collections up to 1.0 know no other names.
        """
        contract = self.contract.called(lambda name: in_pods(name, templates))
        return replace(self, contract=contract, watch=soak, ends=ends)

    def data(self) -> dict[str, str]:
        """As the ConfigMap has it."""
        said = {"run": self.run, "apps": self.apps, "proven": self.proven, "ready_timeout": self.ready_timeout}
        watched = {"soak": self.watch, "ends": self.ends} if self.watch else {}
        ignored = {"ignore": self.ignore} if self.ignore else {}
        contract = json.dumps({**self.contract.as_dict(), **said, **watched, **ignored}, sort_keys=True)
        return {CONTRACT: contract, HISTORY: json.dumps(self.history, sort_keys=True)}


def record_of(item: Object | None) -> Record:
    """That of a ConfigMap. What cannot be read there is not there."""
    data = (item or {}).get("data") or {}
    said, history = _json(data.get(CONTRACT)) or {}, _entries(_json(data.get(HISTORY)))
    try:
        return Record(
            Contract.from_dict(said),
            history,
            str(said.get("run") or ""),
            tuple(map(str, said.get("apps") or ())),
            bool(said.get("proven")),
            float(said.get("ready_timeout") or READY_TIMEOUT),
            float(said.get("soak") or 0.0),
            int(said.get("ends") or 0),
            tuple(map(str, said.get("ignore") or ())),
        )
    except (ArithmeticError, AttributeError, KeyError, TypeError, ValueError):
        return Record(history=history)


def _entries(history: Any) -> tuple[dict[str, Any], ...]:
    there = history if isinstance(history, list) else []
    return tuple(one for one in there if isinstance(one, dict) and isinstance(one.get("deployment"), dict))


def _json(text: Any) -> Any:
    try:
        return json_of(text or "null")
    except (TypeError, ValueError):
        return None


def answer(deployment: Object, records: Mapping[str, Record]) -> str:
    """What the version of a Deployment is. `records`: app -> its record, those of all apps of its step among them.

    Whoever asks has no other rule: the plan, an installation, the keeper's way back, the hold of goals.
    """
    record, revision = records.get(name_of(deployment)), revision_of(deployment)
    if record is None or not record.revision:
        return UNKNOWN
    # whichever revision it is: two installations may have been cut off one after the other
    if record.contract.install and not (record.proven or record.history):
        return INSTALLED
    this, earlier = record.revision == revision, record.is_history(revision)
    proven = _is_proven(record, records)
    if this and (proven or not earlier or record.is_by(mark_of(deployment), revision)):
        return PROVEN if proven else ON_TRIAL
    if earlier:
        return PROVEN if proven or not record.is_by(mark_of(deployment), revision) else GOING_BACK
    return UNKNOWN  # nobody of ours has written it down


def soaks(deployment: Object, records: Mapping[str, Record]) -> bool:
    """Whether its run has found it good, and the keeper sees for a while whether it stays so, before it is proven."""
    record, revision = records.get(name_of(deployment), Record()), revision_of(deployment)
    return record.soak > 0 and record.revision == revision and record.is_by(mark_of(deployment, SOAKING), revision)


def _is_proven(record: Record, records: Mapping[str, Record]) -> bool:
    """A step proves all its apps at once, and then says so of one after the other."""
    step = [records[app] for app in record.apps if app in records]
    return record.proven or any(one.proven and (one.run, one.apps) == (record.run, record.apps) for one in step)
