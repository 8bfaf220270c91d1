# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Rigelfiles of the tests: three whole ones, and a small one that a test changes."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml
from ansible_collections.rosops.fleet.plugins.plugin_utils._rigel.fleet import Imported, imported

WHOLE = Path(__file__).resolve().parents[3] / "fixtures" / "rigel"
NAMES = ("pubsub", "service", "action")
JOB = "jobs.deploy_k8s.with.orchestration"
CONTAINER = f"{JOB}.additional_k8s_params.application.spec.template.spec.containers[0]"


def whole(name: str) -> str:
    return (WHOLE / name / "Rigelfile").read_text("utf-8")


def container(**keys: Any) -> dict[str, Any]:
    """A container that runs, with these keys beside."""
    return {"name": "ros-app", "image": "x.example/arm:1.0", "command": ["/run"], **keys}


def orchestration(*containers: Mapping[str, Any], pod: Mapping[str, Any] | None = None, **keys: Any) -> dict[str, Any]:
    """What a job of the orchestration plugin is given."""
    spec = {"template": {"spec": {"containers": [*containers] or [container()], **(pod or {})}}}
    return {"additional_k8s_params": {"application": {"spec": spec}}, **keys}


def text(given: Mapping[str, Any], **top: Any) -> str:
    """A Rigelfile with one job that deploys."""
    jobs = {"deploy_k8s": {"plugin": "src.plugin.OrchestrationPlugin", "with": {"orchestration": given}}}
    return yaml.safe_dump({"jobs": {**jobs, **top.pop("jobs", {})}, **top})


def made(given: Mapping[str, Any], environment: Mapping[str, str] | None = None, **top: Any) -> Imported:
    return imported(text(given, **top), "Rigelfile", environment or {}, "arms")


def app(found: Imported) -> dict[str, Any]:
    """The one app."""
    [only] = found.robots["ros_apps"]
    return dict(only)


def verdicts(found: Imported) -> dict[str, str]:
    """By path; of several notes the last one."""
    return {note.path: note.verdict for note in found.notes}


def told(found: Imported, path: str) -> str:
    """All that was said at a path."""
    return "\n".join(note.told for note in found.notes if note.path == path)
