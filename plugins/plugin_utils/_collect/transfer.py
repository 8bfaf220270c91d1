# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Brings the files of one claim here, piece by piece: what is not here yet, each with its sum compared."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from ansible_collections.rosops.fleet.plugins.module_utils._host.claims import opened_data, unwire
from ansible_collections.rosops.fleet.plugins.plugin_utils._collect.store import Store

BATCH = 8 << 20  # bytes of one call: what this process, the connection and the robot hold at a time
MANY = 500  # pieces of one call
Piece = dict[str, Any]
Ask = Callable[[list[Piece]], list[dict[str, Any]]]
States = Mapping[str, Mapping[str, int]]

# GREW: what is here are the bytes that it had when it was listed, and they are still its first ones
FETCHED, GREW, CHANGED, GONE = "fetched", "fetched, and written to meanwhile", "changed meanwhile", "gone meanwhile"


def wanted(store: Store, files: States) -> list[str]:
    """The files that are not here as they are there."""
    return [name for name in sorted(files) if not store.same(name, files[name])]


def fetch(ask: Ask, store: Store, files: States, names: Sequence[str]) -> dict[str, str]:
    """Bring these files; the outcome of each. One that was changed meanwhile is not kept, what was here stays."""
    outcomes: dict[str, str] = {}
    sums: dict[str, str] = {}
    starts = _starts(ask, store, files, names)
    for batch in _batches(files, names, starts):
        for piece, found in zip(batch, ask(batch), strict=True):
            name = piece["path"]
            if name in outcomes:
                continue
            if "gone" in found:
                outcomes[name] = GONE
                store.drop(name)
                continue
            store.append(name, piece["offset"], opened_data(found, piece["length"]))
            if piece["check"] is not None:
                outcomes[name] = _ended(store, name, files[name], found, sums)
    store.tidy()
    if sums:
        store.write_sums(sums)
    return outcomes


def _ended(store: Store, name: str, listed: Mapping[str, int], found: Mapping[str, Any], sums: dict[str, str]) -> str:
    """A file's last piece has come: whether it is what the robot has, or had when it was listed."""
    if found["inode"] != listed["inode"] or store.sum_of(store.begun(name), listed["size"]) != found["sha256"]:
        store.drop(name)
        return CHANGED
    store.finish(name, listed["mtime_ns"])
    sums[os.fsdecode(unwire(name))] = found["sha256"]
    return FETCHED if all(found[key] == value for key, value in listed.items()) else GREW


def _starts(ask: Ask, store: Store, files: States, names: Sequence[str]) -> dict[str, int]:
    """Where each file goes on: behind what is here already and begins like the robot's."""
    begun = {name: size for name in names if (size := store.start(name, files[name]["size"]))}
    found: dict[str, int] = {}
    for batch in _chunks([{"path": name, "offset": 0, "length": 0, "check": size} for name, size in begun.items()]):
        for piece, answer in zip(batch, ask(batch), strict=True):
            name, size = piece["path"], piece["check"]
            if answer.get("sha256") == store.sum_of(store.begun(name), size):
                found[name] = size
    return found


def _chunks(pieces: list[Piece]) -> Iterator[list[Piece]]:
    for first in range(0, len(pieces), MANY):
        yield pieces[first : first + MANY]


def _batches(files: States, names: Sequence[str], starts: Mapping[str, int]) -> Iterator[list[Piece]]:
    """Pieces of files for one call after the other; the last one of a file asks for its sum."""
    batch: list[Piece] = []
    room = BATCH
    for name in names:
        at, size = starts.get(name, 0), files[name]["size"]
        while True:
            length = min(size - at, room)
            last = at + length == size
            batch.append({"path": name, "offset": at, "length": length, "check": size if last else None})
            at, room = at + length, room - length
            if not room or len(batch) == MANY:
                yield batch
                batch, room = [], BATCH
            if last:
                break
    if batch:
        yield batch
