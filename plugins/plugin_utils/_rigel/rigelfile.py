# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The text of a Rigelfile: what jobs and sequences it has. Where jobs stand differs between Rigel's versions."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import yaml
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.finding import join_path, shown
from ansible_collections.rosops.fleet.plugins.plugin_utils._rigel.variables import Variables

ORCHESTRATOR = "OrchestrationPlugin"
_AT_THE_TOP = ("deploy_k8s", "update_k8s")  # as the dissertation's listings have them


class Job(NamedTuple):
    """One job: its name, where it stands, its plugin, what it is given, and whether it deploys or updates."""

    name: str
    path: str
    plugin: str
    given: Mapping[str, Any]

    @property
    def orchestrates(self) -> bool:
        return (
            "orchestration" in self.given or self.plugin.rpartition(".")[2] == ORCHESTRATOR or self.name in _AT_THE_TOP
        )

    @property
    def updates(self) -> bool:
        """Whether it changes what another job deployed."""
        return self.orchestrates and "update" in self.name


class Rigelfile(NamedTuple):
    """The file, with its variables filled in."""

    name: str
    jobs: tuple[Job, ...]
    sequences: Mapping[str, Any]
    distro: str
    rest: Mapping[str, Any]
    variables: Variables


def parsed(text: str, name: str) -> Mapping[str, Any]:
    """The mapping that the text is; an error says the line."""
    try:
        found = yaml.safe_load(text)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        where = f"{name}:{mark.line + 1}:{mark.column + 1}" if mark else name
        said = ", ".join(filter(None, [error.context, error.problem]))
        raise SpecError(f"{where}: is no YAML: {said}; mend the line") from error
    except yaml.YAMLError as error:
        raise SpecError(f"{name}: is no YAML: {error}; save it as text in UTF-8") from error
    if not isinstance(found, Mapping):
        raise SpecError(f"{name}: is {shown(found)}; a Rigelfile is a mapping with jobs")
    return found


def rigelfile(text: str, name: str, environment: Mapping[str, str]) -> Rigelfile:
    """The Rigelfile of this text. `environment` is what Rigel takes a variable from that is not under `vars`."""
    raw = dict(parsed(text, name))
    variables = Variables(_mapping(raw.pop("vars", None), "vars"), environment)
    jobs = tuple(_job(key, path, given, variables) for key, path, given in _jobs(raw))
    application = _mapping(raw.pop("application", None), "application")
    packages = _mapping(raw.pop("packages", None), "packages")
    distro = str(variables.filled(application.get("distro") or raw.pop("distro", ""), "application.distro"))
    rest = {
        **{f"application.{key}": item for key, item in application.items() if key not in ("distro", "jobs")},
        **{f"packages.{key}": item for key, item in packages.items()},
    }
    sequences = _mapping(raw.pop("sequences", None), "sequences")
    for key in ("jobs", *_AT_THE_TOP):
        raw.pop(key, None)
    return Rigelfile(name, jobs, sequences, distro, {**rest, **raw}, variables)


def _jobs(raw: Mapping[str, Any]) -> Iterator[tuple[str, str, Any]]:
    application, packages = raw.get("application"), raw.get("packages")
    places = [("jobs", raw.get("jobs"))]
    if isinstance(application, Mapping):
        places.append(("application.jobs", application.get("jobs")))
    if isinstance(packages, Mapping):
        places += [
            (f"packages.{key}.jobs", one.get("jobs")) for key, one in packages.items() if isinstance(one, Mapping)
        ]
    for place, found in places:
        for key, given in _mapping(found, place).items():
            yield str(key), join_path(place, str(key)), given
    for key in _AT_THE_TOP:
        if key in raw:
            yield key, key, raw[key]


def _job(name: str, path: str, given: Any, variables: Variables) -> Job:
    job = _mapping(given, path)
    made = Job(name, path, str(job.get("plugin", "")), _mapping(job.get("with"), f"{path}.with"))
    # what has no counterpart is not looked into: its variables may be of other jobs' making
    return made._replace(given=variables.filled(made.given, f"{path}.with")) if made.orchestrates else made


def _mapping(value: Any, path: str) -> Mapping[str, Any]:
    if value is None:
        return {}
    if not isinstance(value, Mapping):
        raise SpecError(f"{path}: is {shown(value)}; allowed: a mapping")
    return value
