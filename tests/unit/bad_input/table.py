# SPDX-License-Identifier: GPL-3.0-or-later
"""The table of inputs that must be refused (cases.yml), made whole: for the unit tests and for the end-to-end run."""

from __future__ import annotations

import copy
import re
from pathlib import Path
from typing import Any

import yaml

GROUPS = {"edge": ["edge1"], "robots": ["robot1"]}
LAUNCHED: dict[str, Any] = {"args": None, "launch": {"package": "base", "file": "bringup.launch"}}
GOOD_APP = {"name": "talker", "image": "example.org/talker:1.0", "args": ["talk"], "placement": "local"}
# What a path begins with that a case says: `app`, or `apps[1]`.
PLACES = {
    "app": "hosts.robot1.ros_apps[0]",
    "launched": "hosts.robot1.ros_apps[0]",
    "launch": "hosts.robot1.ros_apps[0].launch",
    "robot": "hosts.robot1",
    "edge": "hosts.edge1",
    "volumes": "hosts.robot1.persistent_storage.volumes",
    "apps": "hosts.robot1.ros_apps",
}


def load_cases() -> list[dict[str, Any]]:
    """All cases as those that are `others` in the file; beside what each `says` its `path` and its `words`."""
    table = yaml.safe_load((Path(__file__).resolve().parent / "cases.yml").read_text("utf-8"))
    cases: list[dict[str, Any]] = table.pop("others")
    for key, rows in table.items():
        cases += [{key: given, "says": key + (said if said[0] == "[" else f".{said}")} for said, given in rows.items()]
    for case in cases:
        case["path"], words = whole_path(case["says"]).split(": ", 1)
        case["words"] = words.removeprefix("...; ")
    return cases


def whole_path(said: str) -> str:
    """A line with its path from the hosts on."""
    return re.sub(r"^\w+(?=[.\[:])", lambda found: PLACES.get(found[0], found[0]), said)


def fleet_of(case: dict[str, Any]) -> dict[str, Any]:
    """The input of a case: `{groups: {..}, hosts: {..}}`."""
    groups = {**(case.get("groups") or GROUPS)}
    groups.setdefault("all", list(dict.fromkeys(host for group in groups.values() for host in group)))
    hosts: dict[str, Any] = {host: {} for host in groups["all"]}
    said = {"edge1": case.get("edge"), "robot1": case.get("robot"), **(case.get("vars") or {})}
    hosts.update(copy.deepcopy({host: variables for host, variables in said.items() if variables}))
    if "volumes" in case:
        hosts["robot1"]["persistent_storage"] = {"volumes": copy.deepcopy(case["volumes"])}
    launched = {**LAUNCHED, **case.get("launched", {}), "launch": {**LAUNCHED["launch"], **case.get("launch", {})}}
    one = launched if {"launched", "launch"} & {*case} else case.get("app")
    apps = case.get("apps") or ([] if one is None else [one])
    if apps:
        hosts["robot1"]["ros_apps"] = [changed_app(app) for app in apps]
    return {"groups": groups, "hosts": hosts}


def changed_app(changes: dict[str, Any]) -> dict[str, Any]:
    """The good app with some keys changed, and those that are null taken out."""
    merged = {**copy.deepcopy(GOOD_APP), **copy.deepcopy(changes)}
    return {key: value for key, value in merged.items() if key not in changes or changes[key] is not None}


def missing_words(case: dict[str, Any], text: str) -> list[str]:
    """What a message fails to say: one of its lines must begin with the path, and have the words."""
    lines = [line for line in text.splitlines() if line.strip().startswith(f"{case['path']}: ")]
    return [] if any(case["words"] in line for line in lines) else [case["says"]]
