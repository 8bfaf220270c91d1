# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Jobs and sequences that are no inventory: what takes their place."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from ansible_collections.rosops.fleet.plugins.plugin_utils._model.finding import join_path
from ansible_collections.rosops.fleet.plugins.plugin_utils._rigel.part import CHANGED, LEFT, TAKEN, Notes
from ansible_collections.rosops.fleet.plugins.plugin_utils._rigel.rigelfile import Job, Rigelfile

_CI = "your CI builds the image and pushes it under a new tag; then change image in ros_apps"
_TESTS = (
    "tests of the application are your CI's; a fleet of it runs in the lab, see docs/howto.md (Try it without robots)"
)
# By what the plugin's class, or else the job, is called.
_PLACES = (
    (("dockerfile",), LEFT, "write the Dockerfile, your CI builds the image of it"),
    (("buildx", "build"), LEFT, f"{_CI}. An image that is in no registry: docker save, and images_archives"),
    (("registry", "ecr", "push"), LEFT, f"{_CI}. The robots' login is robot_namespace_pull_secrets"),
    (("compose", "test", "introspection", "simulation"), LEFT, _TESTS),
    (("robomaker", "worldforge", "aws"), LEFT, "simulations in the cloud are your CI's"),
)


def told_job(job: Job, notes: Notes) -> None:
    """Say what becomes of a job that is none of the orchestration plugin's."""
    called = f"{job.plugin.rpartition('.')[2]} {job.name}".lower()
    for words, verdict, told in _PLACES:
        if any(word in called for word in words):
            notes.say(job.path, verdict, told)
            return
    plugin = f" {job.plugin}" if job.plugin else ""
    notes.say(job.path, LEFT, f"the plugin{plugin} is not known here; a task of your own in a playbook")


def sequence_notes(file: Rigelfile, notes: Notes) -> None:
    """Say for every sequence which commands it is."""
    jobs = {job.name: job for job in file.jobs}
    for name, given in file.sequences.items():
        path = join_path("sequences", str(name))
        for key, what in (("matrix", "a matrix is your CI's"), ("dependencies", "CI's jobs know what they need")):
            if _has(given, key):
                notes.say(f"{path}.{key}", LEFT, what)
        steps = list(dict.fromkeys(_step(jobs.get(job), job) for job in _names(given)))
        notes.say(path, TAKEN if len(steps) == 1 else CHANGED, "; then ".join(steps) or "it has no job")


def _step(job: Job | None, name: str) -> str:
    if job is None or not job.orchestrates:
        return f"{name}: in your CI"
    return f"ansible-playbook rosops.fleet.{'update' if job.updates else 'site'}"


def _names(value: Any) -> Iterator[str]:
    """The jobs of a sequence in their order, whatever stages they are in."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, list):
        for item in value:
            yield from _names(item)
    elif isinstance(value, Mapping):
        if "name" in value:
            yield str(value["name"])
        for key in ("stages", "dependencies", "jobs", "parallel"):
            yield from _names(value.get(key, []))


def _has(value: Any, key: str) -> bool:
    if isinstance(value, list):
        return any(_has(item, key) for item in value)
    return isinstance(value, Mapping) and (key in value or any(_has(item, key) for item in value.values()))
