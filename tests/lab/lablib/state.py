# SPDX-License-Identifier: GPL-3.0-or-later
"""What is remembered of a lab between two commands: its network and hosts, and which artifacts go with it."""

from __future__ import annotations

import json
import os
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from .errors import LabError
from .paths import COMMAND, STATE, state_dir

ARTIFACTS = STATE / "artifacts.json"


@dataclass(frozen=True)
class Host:
    """One host of a lab, with the address that it keeps."""

    name: str
    group: str
    address: str


@dataclass(frozen=True)
class LabState:
    """A lab as it was set up."""

    name: str
    subnet: str
    hosts: tuple[Host, ...]

    def host(self, name: str) -> Host:
        for host in self.hosts:
            if host.name == name:
                return host
        known = ", ".join(host.name for host in self.hosts)
        raise LabError(f"lab {self.name} has no host {name}", todo=f"its hosts are {known}")


def load(lab: str) -> LabState | None:
    """The state of a lab, or None where there is none that can be read: the next `lab up` writes it anew."""
    try:
        data = json.loads((state_dir(lab) / "lab.json").read_text())
        return LabState(data["name"], data["subnet"], tuple(Host(**host) for host in data["hosts"]))
    except (FileNotFoundError, ValueError, KeyError, TypeError):
        return None


def require(lab: str) -> LabState:
    found = load(lab)
    if found is None:
        raise LabError(f"lab {lab} is not up", where=str(state_dir(lab)), todo=f"run {COMMAND} up --lab {lab}")
    return found


def save(state: LabState) -> None:
    write_whole(state_dir(state.name) / "lab.json", json.dumps(asdict(state), indent=2) + "\n")


def write_whole(path: Path, text: str) -> None:
    """Never half a file, whatever happens while it is written."""
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(f".{path.name}.{os.getpid()}")
    part.write_text(text)
    part.rename(path)


def save_artifacts(values: dict[str, Any]) -> None:
    write_whole(ARTIFACTS, json.dumps(values, indent=2) + "\n")


def load_artifacts() -> dict[str, Any]:
    try:
        values: dict[str, Any] = json.loads(ARTIFACTS.read_text())
    except (FileNotFoundError, ValueError):
        return {}
    return values
