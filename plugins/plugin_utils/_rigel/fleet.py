# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""A whole Rigelfile as a fleet: its inventory's variables, checked as every inventory is, and what was said of it."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import PurePosixPath
from typing import Any, NamedTuple

from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.finding import Problem
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.secrets import is_secret
from ansible_collections.rosops.fleet.plugins.plugin_utils._rigel.application import UNTOLD
from ansible_collections.rosops.fleet.plugins.plugin_utils._rigel.jobs import sequence_notes, told_job
from ansible_collections.rosops.fleet.plugins.plugin_utils._rigel.orchestration import Deployed, deployed, inside
from ansible_collections.rosops.fleet.plugins.plugin_utils._rigel.part import (
    CHANGED,
    LEFT,
    OPEN,
    SAME,
    TAKEN,
    Note,
    Notes,
    Part,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._rigel.rigelfile import Job, Rigelfile, rigelfile
from ansible_collections.rosops.fleet.plugins.plugin_utils._validate.fleet import check_fleet

EDGE, ROBOT = "edge1", "robot1"
HOSTS = {EDGE: "192.0.2.10", ROBOT: "192.0.2.21"}  # of no network (RFC 5737)


class Imported(NamedTuple):
    """Variables of all hosts and of robots, files of dashboards, and notes on every key."""

    all: dict[str, Any]
    robots: dict[str, Any]
    dashboards: tuple[str, ...]
    notes: tuple[Note, ...]


def imported(text: str, name: str, environment: Mapping[str, str], fleet_name: str) -> Imported:
    """The fleet of a Rigelfile's text. SpecError has all that cannot be imported as it stands."""
    file = rigelfile(text, name, environment)
    notes = Notes()
    jobs = [job for job in file.jobs if job.orchestrates and not job.updates]
    if not jobs:
        known = ", ".join(job.name for job in file.jobs) or "none"
        raise SpecError(
            f"{name}: has no job that deploys (its jobs: {known}); one with an orchestration, as deploy_k8s"
        )
    runs = _image_runs(file)
    parts = [(job, deployed(job, file.distro, runs, notes)) for job in jobs]
    for job in file.jobs:
        if job.updates:
            _told_update(job, notes)
        elif not job.orchestrates:
            told_job(job, notes)
    found = _joined(parts, notes, fleet_name)
    origins = [job.path for job, one in parts for _app in one.apps]
    _settle_handoffs(found, origins, notes)
    notes.problems += _wrong(found, origins)
    if notes.problems:
        lines = "\n".join(problem.line() for problem in notes.problems)
        raise SpecError(f"{name} cannot be imported as it stands; change it, or a copy of it:\n{lines}")
    sequence_notes(file, notes)
    _told_rest(file, notes)
    variables = {one.name: one.value for one in file.variables.used.values()}
    return found._replace(all={**found.all, **variables}, notes=tuple(dict.fromkeys(notes.all)))


def _image_runs(file: Rigelfile) -> str:
    """What the image runs by itself, where one job alone says it."""
    said = [job.given["command"] for job in file.jobs if not job.orchestrates and job.given.get("command")]
    if len(said) != 1:
        return ""
    return str(file.variables.filled(str(said[0]), "jobs.dockerfile.with.command"))


def _joined(parts: list[tuple[Job, Deployed]], notes: Notes, fleet_name: str) -> Imported:
    """What several jobs deploy is one fleet: what they say of all of it, the first one says."""
    first = parts[0][1]
    volumes: dict[str, dict[str, Any]] = {}
    for job, one in parts:
        for key, ours, theirs in (
            ("deploy_ros_master", first.master, one.master),
            ("observability", first.observability, one.observability or first.observability),
        ):
            if theirs != ours:
                told = f"a fleet has one; that of {parts[0][0].path} is taken"
                notes.say(f"{job.path}.with.orchestration.{key}", CHANGED, told)
        for volume in one.volumes:
            if volumes.setdefault(volume["name"], volume) != volume:
                notes.say(
                    f"{job.path}.with.orchestration.persistent_storage", CHANGED, f"{volume['name']}: the first job's"
                )
    dashboards = tuple(dict.fromkeys(path for _job, one in parts for path in one.dashboards))
    watching = {"observability": first.observability} if first.observability else {}
    shown = [f"../dashboards/{PurePosixPath(path).name}" for path in dashboards]
    return Imported(
        all={"fleet_name": fleet_name, **watching, **({"observability_dashboards": shown} if shown else {})},
        robots={
            **first.master,
            **({"persistent_storage": {"volumes": list(volumes.values())}} if volumes else {}),
            "ros_apps": [app for _job, one in parts for app in one.apps],
        },
        dashboards=dashboards,
        notes=(),
    )


def _settle_handoffs(found: Imported, origins: list[str], notes: Notes) -> None:
    """Rigel rolls whatever it is; here some cannot overlap, and the validation knows which."""
    for index, origin in enumerate(origins):
        app = found.robots["ros_apps"][index]
        if app.get("handoff") != "overlap":
            continue
        before = _problems(found)
        del app["handoff"]
        wrong = [problem for problem in before if problem not in _problems(found)]
        if wrong:
            where = wrong[0].path.rpartition(f".ros_apps[{index}].")[2]
            told = (
                f"{app['name']} is replaced, not overlapped, as {where} {wrong[0].problem}; allowed: {wrong[0].allowed}"
            )
            notes.say(f"{origin}.with.orchestration.rolling_update", OPEN, told)
        else:
            app["handoff"] = "overlap"


def _problems(found: Imported) -> list[Problem]:
    """What the validation says of the fleet."""
    variables = json.loads(json.dumps({**found.all, **found.robots}))  # plain texts
    edge = json.loads(json.dumps(found.all))
    groups = {"all": [*HOSTS], "edge": [EDGE], "robots": [ROBOT]}
    return check_fleet({"groups": groups, "hosts": {EDGE: edge, ROBOT: variables}}).problems


def _wrong(found: Imported, origins: list[str]) -> Iterator[Problem]:
    for problem in _problems(found):
        path = problem.path.removeprefix(f"hosts.{ROBOT}.").removeprefix(f"hosts.{EDGE}.")
        index = path.partition("ros_apps[")[2].partition("]")[0]
        origin = origins[int(index)] if index else origins[0]
        yield problem._replace(path=f"{origin}: as {path}")


def _told_update(job: Job, notes: Notes) -> None:
    """A job that updates says again what the one that deploys says: an update is the inventory, changed."""
    part = Part(job.given, f"{job.path}.with", notes)
    orchestration = part.part("orchestration")
    orchestration.leave("rolling_update", "an app has one handoff: that of the job that deploys is taken", CHANGED)
    for one in (orchestration, part):
        one.leave("readiness", "an app has one readiness: that of the job that deploys is taken", CHANGED)
    if inside(orchestration.value, "additional_k8s_params", "application"):
        orchestration.leave(
            "additional_k8s_params", "change the app in ros_apps, then ansible-playbook rosops.fleet.update", OPEN
        )
    orchestration.end("an update is a change of the inventory, then ansible-playbook rosops.fleet.update")
    part.end("an update is a change of the inventory, then ansible-playbook rosops.fleet.update")
    notes.say(
        job.path,
        TAKEN,
        "ansible-playbook rosops.fleet.update, after a change of image in ros_apps; back: rosops.fleet.rollback",
    )


def _told_rest(file: Rigelfile, notes: Notes) -> None:
    if file.distro:
        notes.say(
            "application.distro",
            TAKEN,
            f"ros_master_image, where the Rigelfile names no other: ros:{file.distro}-ros-core",
        )
    for path in file.rest:
        known = {
            "providers": "logins of registries are robot_namespace_pull_secrets, in Ansible Vault; others are your CI's"
        }
        notes.say(path, LEFT, known.get(path, "it is for building and testing the image, in your CI"))
    for path in dict.fromkeys(file.variables.filtered):
        notes.say(path, CHANGED, "Rigel hands a variable with a filter on as text, Ansible fills it in")
    for key, value in file.variables.declared.items():
        used = file.variables.used.get(key)
        if used:
            secret = f"; it {UNTOLD}" if is_secret(key) else ""
            notes.say(f"vars.{key}", OPEN if secret else TAKEN, f"{used.name} in group_vars/all.yml{secret}")
        elif key in file.variables.read:
            notes.say(f"vars.{key}", SAME, "stands where it is used")
        else:
            notes.say(f"vars.{key}", LEFT, "nothing that was imported uses it" if value is not None else "it is empty")
    for key, used in file.variables.used.items():
        if key not in file.variables.declared:
            notes.say(
                f"vars.{key}",
                OPEN,
                f"{used.name} reads the environment of ansible-playbook, as Rigel does; or give it a value",
            )
