# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What is to be done about k3s on a host: what k3s_info found there against what should be. Pure; control node."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from typing import Any

from ansible_collections.rosops.fleet.plugins.module_utils._host.k3s import BINARY

# states of a unit out of which only a restart brings something new in
UP = ("active", "activating", "reloading", "deactivating")
# verdicts of k3s_info with which a token must be written
WRITE = ("absent", "restore")


def file_changes(wanted: Sequence[Mapping[str, Any]], found: Mapping[str, Any]) -> dict[str, list[Any]]:
    """What must be done about the files: `open` and `secret` ones to write, and those to `remove` (empty content).

    `found` is what k3s_info saw. Comparing digests here spares a host on which nothing changed a task per file.
    """
    changes: dict[str, list[Any]] = {"open": [], "secret": [], "remove": []}
    for file in wanted:
        there = found[file["path"]]
        if not file["content"]:
            changes["remove"] += [file["path"]] if there["exists"] else []
        elif (there["sha256"], there["mode"]) != (hashlib.sha256(file["content"].encode()).hexdigest(), file["mode"]):
            changes["secret" if file["secret"] else "open"].append(dict(file))
    return changes


def missing_tokens(now: Mapping[str, Any], names: Sequence[str], init: bool) -> list[str]:
    """Tokens to write. A host that has not joined takes all anew: those it has may be an earlier cluster's."""
    if not init and not now["data"]:
        return list(names)
    verdicts = {"token": now["tokens"]["server"], "agent-token": now["tokens"]["agent"]}
    return [name for name in names if verdicts[name] in WRITE]


def plan(now: Mapping[str, Any], wanted: Mapping[str, Any]) -> dict[str, Any]:
    """Everything that is to be done, and `any`: whether there is anything.

    `wanted` has `init` (starts the cluster), `tokens` (names of files), `files`, `checksum` of the binary or, where
    that is not known beforehand, its `version`, `archive` (name and size; no name: none), `kubeconfig` (whether this
    host gives one, and whether the one on the control node is right).
    """
    binary = (
        now["files"][BINARY]["sha256"] != wanted["checksum"]
        if wanted["checksum"]
        else now["version"] != wanted["version"]
    )
    tokens = missing_tokens(now, wanted["tokens"], wanted["init"])
    changes = file_changes(wanted["files"], now["files"])
    changed = bool(binary or tokens or any(changes.values()) or now["stale"])
    up = now["service"]["active"] in UP
    start = changed or not up or not now["service"]["enabled"]
    kubeconfig = wanted["kubeconfig"]["given"] and (start or not wanted["kubeconfig"]["right"])
    archive = wanted["archive"]
    work: dict[str, Any] = {
        "binary": binary,
        "archive": bool(archive["name"]) and now["images"].get(archive["name"]) != archive["size"],
        "tokens": tokens,
        "files": changes,
        "start": start,
        "wait": start or not now["ready"],
        "kubeconfig": kubeconfig,
    }
    needed = any(any(value.values()) if isinstance(value, dict) else bool(value) for value in work.values())
    # A unit that is up and only not enabled is not restarted for that.
    return {**work, "state": "restarted" if up and changed else "started", "any": needed}
