# SPDX-License-Identifier: GPL-3.0-or-later
"""What the keeper knows of one ROS graph and its parameters, what follows from each look, and where it is kept.

Pure but for the files: time is told to it, by a clock that nobody sets. It brings back a registration only if its node
lives and has it by its own word, and takes one away only of a node that is gone for certain; see `registrations`.
"""

from __future__ import annotations

import json
import os
import xmlrpc.client
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Callable, Iterator, Mapping, Sequence

from .._ros import registrations
from .._ros.registrations import Call, Entry, Liveness
from .._ros.replies import loads

AGAIN = 5.0  # seconds between two looks at a node, at least
PERIOD = 10.0  # seconds between looks at a node that answered
MEMORY = 86400.0  # seconds that a removed node is remembered
REMEMBERED = 200
# The master's own: roscore sets them anew, and they name the run.
OWN = frozenset({"run_id", "rosversion", "rosdistro"})
BOOT = Path("/proc/sys/kernel/random/boot_id")


def boot_of_host() -> str:
    """What tells this boot of the host from another."""
    try:
        return BOOT.read_text("ascii").strip()
    except OSError:
        return ""


@dataclass(frozen=True)
class Silence:
    """What became of the last questions: node -> its address and for how many seconds it has not answered."""

    silent: Mapping[str, tuple[str, float]] = field(default_factory=dict)
    answering: frozenset[str] = frozenset()  # addresses (URIs) of nodes that answered


@dataclass
class Memory:
    """Nodes and their registrations: of those that are there, and of those that were removed."""

    master: tuple[Any, ...] = ()  # what tells this run of the master from another
    boot: str = ""  # of the host, in which all this was seen
    nodes: dict[str, Entry] = field(default_factory=dict)
    removed: dict[str, tuple[Entry, float]] = field(default_factory=dict)  # with the time
    missed: dict[str, float] = field(default_factory=dict)  # node that lacks something -> after when to ask it
    suspects: dict[str, float] = field(default_factory=dict)  # node -> when it was first found gone
    seen: dict[str, float] = field(default_factory=dict)  # node -> when it was last looked at
    silent: dict[str, float] = field(default_factory=dict)  # node -> first look in vain, since when all were
    unsure: set[str] = field(default_factory=set)  # nodes that were given back what they had, and did not say a word
    left: set[str] = field(default_factory=set)  # nodes of which the master had nothing when it was looked at last

    # ---- what is there

    def unknown(self, present: Mapping[str, Entry]) -> dict[str, Entry]:
        """Nodes whose process id is not known yet."""
        return {
            node: entry
            for node, entry in present.items()
            if node not in self.nodes or self.nodes[node].uri != entry.uri or self.nodes[node].pid is None
        }

    def learn(self, present: Mapping[str, Entry], pids: Mapping[str, int | None]) -> None:
        """Add what the master has. What it has not stays: only its node can say that it is over."""
        for node, entry in present.items():
            known = self.nodes.get(node)
            if known is None or known.uri != entry.uri:
                self.forget(node)
                known = Entry(entry.uri)
            self.nodes[node] = Entry(
                entry.uri,
                pids.get(node) if known.pid is None else known.pid,
                {**known.publications, **entry.publications},
                {**known.subscriptions, **entry.subscriptions},
                {**known.services, **entry.services},
            )
            if node in self.removed and self.removed[node][0].uri != entry.uri:
                del self.removed[node]  # a newer process has the name

    def forget(self, node: str) -> None:
        self.nodes.pop(node, None)
        for table in (self.missed, self.suspects, self.seen, self.silent):
            table.pop(node, None)
        self.unsure.discard(node)
        self.left.discard(node)

    # ---- what the master has lost

    def lost(self, present: Mapping[str, Entry], now: float, at_once: bool = False) -> dict[str, Entry]:
        """What is missing at the master and due to be asked for. A node that is just leaving misses something, too:
        except after a restart of the master, only what is missing in two looks counts.
        """
        need = registrations.missing(self.nodes, present)
        self.missed = {node: self.missed.get(node, now) for node in need}
        if not at_once:
            self.left = need.keys() - present.keys()
        due = {}
        for node, entry in need.items():
            there = present.get(node)
            if there is not None and there.uri != entry.uri:
                continue  # a newer process has the name; learn() takes it up
            if at_once or self.missed[node] < now:
                due[node] = entry
                self.missed[node] = now + AGAIN
        return due

    def settle(
        self,
        need: Mapping[str, Entry],
        present: Mapping[str, Entry],
        answers: Mapping[str, Liveness],
        restarted: float = 0,
        late: bool = False,
    ) -> tuple[Call, ...]:
        """The calls that bring back what was lost. What a node says it no longer has is over, and what the dead had.

        Unless the master was `restarted` just then: the dead did not leave, so they are remembered as removed.
        `late`: who does not answer gets back what it had, until it says what it has. Not who had left before: its pod
        may be gone, and then nobody answers for it ever.
        """
        silent = {node for node in need if answers[node].verdict == registrations.UNKNOWN}
        asked = {node: entry for node, entry in need.items() if node not in silent & self.left}
        calls = registrations.restore(asked, present, answers, late)
        restored = {(call.kind, call.node, call.name) for call in calls}
        self.unsure.update(call.node for call in calls if call.node in silent)
        for node, entry in need.items():
            if restarted and answers[node].verdict == registrations.DEAD:
                self.bury(node, restarted)
            elif node not in silent:

                def stays(kind: str, name: str, node: str = node, entry: Entry = entry) -> bool:
                    return name not in entry.part(kind) or (kind, node, name) in restored

                self._keep_only(node, stays)
        return calls

    def _keep_only(self, node: str, stays: Callable[[str, str], bool]) -> None:
        self.nodes[node] = self.nodes[node].only(stays)
        if self.nodes[node].empty:
            self.forget(node)

    def doubtful(self, answers: Mapping[str, Liveness]) -> dict[str, Entry]:
        """Nodes that were given back what they had without a word of theirs, and answer now."""
        speak = {node for node in self.unsure & answers.keys() if answers[node].verdict == registrations.ALIVE}
        return {node: self.nodes[node] for node in sorted(speak)}

    def correct(self, answers: Mapping[str, Liveness], calls: Sequence[Call]) -> None:
        """The doubtful have said what they have; by these calls the rest was taken back."""
        for node in self.doubtful(answers):
            taken = {(call.kind, call.name) for call in calls if call.node == node}
            self.unsure.discard(node)
            self._keep_only(node, lambda *one, taken=taken: one not in taken)

    # ---- who is gone

    def due(self, present: Mapping[str, Entry], now: float) -> dict[str, Entry]:
        """Nodes to look at now: registered ones, those of which something is missing, and removed ones that might come
        back.
        """
        self.removed = {node: (entry, at) for node, (entry, at) in self.removed.items() if now - at <= MEMORY}
        self.seen = {node: at for node, at in self.seen.items() if node in self.nodes or node in self.removed}
        everyone = {node: entry for node, (entry, _at) in self.removed.items()}
        everyone.update({node: self.nodes[node] for node in (*present, *self.missed) if node in self.nodes})
        found = {}
        for node, entry in everyone.items():
            period = AGAIN if node in {*self.suspects, *self.missed, *self.unsure} else PERIOD
            if node in self.removed:  # the longer it is gone, the less it is worth
                period = max(PERIOD, (now - self.removed[node][1]) / 5)
            if now - self.seen.get(node, now - PERIOD) >= period:
                found[node] = entry
        return found

    def judge(
        self, asked: Mapping[str, Entry], answers: Mapping[str, Liveness], now: float
    ) -> tuple[list[str], list[str]]:
        """Nodes to remove, having been gone twice, and removed ones that are back."""
        gone, back = [], []
        for node, entry in asked.items():
            self.seen[node] = now
            if node in self.removed:
                if not registrations.alive(self.removed[node][0], answers[node]):
                    back.append(node)
                continue
            known = self.nodes.get(node)
            if known is None or known.uri != entry.uri:
                continue  # a newer process took the name while we asked
            if answers[node].verdict == registrations.UNKNOWN:
                self.silent.setdefault(node, now)
            else:
                self.silent.pop(node, None)
            if not registrations.gone(entry, answers[node]):
                self.suspects.pop(node, None)
            elif node not in self.suspects:
                self.suspects[node] = now
            elif now - self.suspects[node] >= AGAIN:
                gone.append(node)
        return gone, back

    def silence(self) -> Silence:
        """Who does not answer, and who did when that was seen last. Only looks count: none was made meanwhile."""
        silent = {node: (self.nodes[node].uri, self.seen[node] - first) for node, first in self.silent.items()}
        since = max((self.seen[node] for node in silent), default=0.0) - 2 * PERIOD
        answered = [node for node, at in self.seen.items() if node in self.nodes and at >= since]
        unsure = {*self.silent, *self.suspects}
        return Silence(silent, frozenset(self.nodes[node].uri for node in answered if node not in unsure))

    def bury(self, node: str, now: float) -> None:
        """It was removed; should the very same process answer again, it gets everything back."""
        self.removed[node] = (self.nodes[node], now)
        while len(self.removed) > REMEMBERED:
            del self.removed[next(iter(self.removed))]
        self.forget(node)
        self.seen[node] = now

    def revive(self, node: str) -> Entry:
        self.nodes[node], _at = self.removed.pop(node)
        return self.nodes[node]

    # ---- as it is kept

    def as_dict(self) -> dict[str, object]:
        return {
            "master": list(self.master),
            "boot": self.boot,
            "left": sorted(self.left),
            "nodes": {node: entry.as_dict() for node, entry in sorted(self.nodes.items())},
            # without the times: no clock that nobody sets outlives a reboot
            "removed": {node: [entry.as_dict()] for node, (entry, _at) in sorted(self.removed.items())},
        }


def from_dict(data: Any, now: float) -> Memory:
    """The reverse of Memory.as_dict(), what was removed as if just now; an empty one of anything else."""
    try:
        return Memory(
            tuple(data["master"]),
            str(data.get("boot", "")),
            {node: registrations.from_dict(entry) for node, entry in data["nodes"].items()},
            {node: (registrations.from_dict(entry), now) for node, (entry,) in data["removed"].items()},
            left=set(map(str, data.get("left", ()))),
        )
    except (AttributeError, KeyError, TypeError, ValueError):
        return Memory()


class KeptFiles:
    """A directory with one JSON file per part, written whole or not at all.

    A disk that is full costs what is kept at the keeper's next start, and nothing now: it is told once.
    """

    def __init__(self, directory: str, log: Callable[[str], None]) -> None:
        self.directory, self.log = Path(directory), log
        self.directory.mkdir(parents=True, exist_ok=True)
        self.lost: set[str] = set()  # parts that could not be written

    def load(self, part: str) -> Any:
        """None: it is not there, or is damaged."""
        try:
            return json.loads((self.directory / f"{part}.json").read_text("utf-8"))
        except (OSError, ValueError):
            return None

    def save(self, part: str, content: Any) -> bool:
        """Whether that could be done. What lies there already is not written again."""
        kept, fresh = self.directory / f"{part}.json", self.directory / f".{part}.new"
        data = json.dumps(content, separators=(",", ":")).encode()
        try:
            if not kept.exists() or kept.read_bytes() != data:
                with fresh.open("wb") as file:
                    file.write(data)
                    file.flush()
                    os.fsync(file.fileno())  # else a power cut may leave the name with nothing behind it
                fresh.replace(kept)
        except OSError as error:
            if part not in self.lost:
                self.log(f"{part}: not on record, and lost if the keeper is started again: {error}")
            self.lost.add(part)
            return False
        if part in self.lost:
            self.log(f"{part}: on record again")
        self.lost.discard(part)
        return True


# ---- parameters


def parameters_text(tree: Any) -> str:
    """The parameter tree as XML-RPC's own text: JSON has neither its dates nor its binary data."""
    kept = {key: value for key, value in tree.items() if key not in OWN} if isinstance(tree, Mapping) else {}
    return xmlrpc.client.dumps((kept,), allow_none=True)


def parameters_of(text: str) -> dict[str, object]:
    """The reverse of parameters_text()."""
    tree = loads(text.encode())[0][0] if text else {}
    return dict(tree) if isinstance(tree, Mapping) else {}


def absent_parameters(wanted: Mapping[str, object], present: object, path: str = "") -> Iterator[tuple[str, object]]:
    """(name, value) of what `present` does not have. A value that is there is left as it is."""
    there = present if isinstance(present, Mapping) else {}
    for key, value in sorted(wanted.items()):
        name = f"{path}/{key}"
        if key not in there:
            yield name, value
        elif isinstance(value, Mapping) and isinstance(there[key], Mapping):
            yield from absent_parameters(value, there[key], name)
