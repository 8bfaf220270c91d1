# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What is to be done about k3s on a host: what k3s_info found there against what should be. Pure; control node."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Sequence

from ...module_utils._common.documents import Result
from ...module_utils._host.k3s import BINARY
from .source import Artifacts
from .wanted import HostFile, Wanted

# states of a unit out of which only a restart brings something new in
UP = ("active", "activating", "reloading", "deactivating")
# verdicts of k3s_info with which a token must be written
WRITE = ("absent", "restore")
ARCHIVE = re.compile(r"k3s-airgap-images-.*-[0-9a-f]{12}[.]tar")


def file_changes(wanted: Sequence[HostFile], found: Result) -> dict[str, list[str]]:
    """Paths of the files to `write` and to `remove` (no content).

    `found` is what k3s_info saw. Comparing digests here spares a host on which nothing changed a task per file.
    """
    changes: dict[str, list[str]] = {"write": [], "remove": []}
    for file in wanted:
        there = found[file.path]
        if not file.content:
            changes["remove"] += [file.path] if there["exists"] else []
        elif (there["sha256"], there["mode"]) != (hashlib.sha256(file.content.encode()).hexdigest(), file.mode):
            changes["write"].append(file.path)
    return changes


def missing_tokens(now: Result, names: Sequence[str], init: bool) -> list[str]:
    """Tokens to write. A host that has not joined takes all anew: those it has may be an earlier cluster's."""
    if not init and not now["data"]:
        return list(names)
    verdicts = {"token": now["tokens"]["server"], "agent-token": now["tokens"]["agent"]}
    return [name for name in names if verdicts[name] in WRITE]


def plan(now: Result, wanted: Wanted, source: Artifacts, version: str, kubeconfig_right: bool) -> Result:
    """Everything that is to be done, and whether there is anything (`any`), but a wait (`undone`). No secret is in it.

    `version` is the binary's where its checksum is not known beforehand; `kubeconfig_right` is whether the one on the
    control node is. `unsure`: it would be changed, is up and has a cluster's data, but did not serve in this one look;
    `down`: it has such data and is not up.
    """
    binary = now["files"][BINARY]["sha256"] != source.sha256 if source.sha256 else now["version"] != version
    tokens = missing_tokens(now, wanted.tokens, wanted.init)
    changes = file_changes(wanted.files, now["files"])
    changed = bool(binary or tokens or any(changes.values()) or now["stale"])
    up = now["service"]["active"] in UP
    start = changed or not up or not now["service"]["enabled"]
    unproven = bool(now["change"]["unproven"])
    works = bool(up and now["ready"] and now["data"])
    told = {
        "works": works,
        "unsure": bool(up and now["data"] and not now["ready"] and (changed or unproven)),
        "down": bool(now["data"] and not up),
    }
    work: Result = {
        "binary": binary,
        "archive": bool(source.archive_name) and now["images"].get(source.archive_name) != source.archive_size,
        "tokens": tokens,
        **changes,
        "start": start,
        "wait": start or unproven or not now["ready"],
        # what serves is changed with care, and what nobody has proven is proven or taken back
        "guarded": (works and changed) or unproven,
        "unproven": unproven,
        "restart": changed,
        "kubeconfig": bool(wanted.kubeconfig) and (start or not kubeconfig_right),
    }
    # A unit that is up and only not enabled is not restarted for that.
    told |= {"any": any(work.values()), "undone": any(value for name, value in work.items() if name != "wait")}
    return {**work, **told, "state": "restarted" if up and changed else "started"}


def old_archives(now: Result, source: Artifacts) -> list[str]:
    """Archives of images of earlier versions."""
    return sorted(name for name in now["images"] if ARCHIVE.match(name) and name != source.archive_name)
