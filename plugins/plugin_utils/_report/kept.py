# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the last runs made of the hosts, as their cluster keeps it for whoever looks next, from wherever. Pure.

One ConfigMap for a cluster, with a key for each host: runs on different hosts do not write over each other. The steps
of updates are in the robots' own ConfigMaps, which the engine writes.
"""

from __future__ import annotations

import json
import time
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from ansible_collections.rosops.fleet.plugins.module_utils._step.objects import Object
from ansible_collections.rosops.fleet.plugins.module_utils._step.update_record import RUNNING, WAITING
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.cache import Ref
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.pods import meta
from ansible_collections.rosops.fleet.plugins.plugin_utils._model import names
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.events import known_events

REF = Ref("ConfigMap", "rosops-outcomes", "kube-system", "v1")
REASON_KEPT = 500  # a ConfigMap holds 1 MiB, and a fleet has many hosts
Row = dict[str, Any]


def kept_part(rows: Iterable[Mapping[str, Any]]) -> Row:
    """What is merged into the ConfigMap. A row is a host's in the report, with `playbook` and `started`."""
    wanted = ("host", "outcome", "failed_task", "changed", "playbook", "started")
    return {
        "data": {
            str(row["host"]): json.dumps(
                {**{key: row.get(key) for key in wanted}, "reason": str(row.get("reason") or "")[:REASON_KEPT]},
                sort_keys=True,
            )
            for row in rows
        }
    }


def kept_object(part: Mapping[str, Any]) -> Row:
    """The ConfigMap where there is none yet."""
    labels = {"app.kubernetes.io/managed-by": names.MANAGER}
    metadata = {"name": REF.name, "namespace": REF.namespace, "labels": labels}
    return {"apiVersion": REF.api_version, "kind": REF.kind, "metadata": metadata, **part}


def kept_runs(found: Mapping[str, Any] | None) -> list[Row]:
    """The last run of each host, as a report of that host alone; what somebody spoilt is left out."""
    runs = []
    for text in ((found or {}).get("data") or {}).values():
        try:
            host = dict(json.loads(text))
            runs.append({"playbook": str(host["playbook"]), "started": str(host["started"]), "hosts": [host]})
        except (ValueError, KeyError, TypeError):
            continue
    return runs


def kept_steps(maps: Sequence[Object]) -> list[Row]:
    """The latest step of each app, as a report of its robot alone."""
    runs = []
    for item in maps:
        robot = str((meta(item).get("labels") or {}).get(names.LABEL_ROBOT) or "")
        events = known_events([item], robot)
        if events:
            started = max(float(event["started"]) for event in events)
            host = {"host": robot, "steps": _steps(events)}
            runs.append({"playbook": "", "started": _utc(started), "hosts": [host]})
    return runs


def _steps(events: Iterable[Mapping[str, Any]]) -> list[Row]:
    """Steps as the report has them; an event is of one app of a step."""
    steps: dict[str, Row] = {}
    for event in sorted(events, key=lambda one: float(one["started"])):
        step = steps.setdefault(
            str(event.get("id")),
            {
                **{key: event.get(key) for key in ("id", "handoff", "outcome", "reason", "phases", "busy_wait")},
                "name": event.get("step"),
                "from": {},
                "to": {},
            },
        )
        for side in ("from", "to"):
            if event.get(side):
                step[side][event["app"]] = {"image": event.get(f"{side}_image"), "revision": event[side]}
        if event.get("outcome") in (RUNNING, WAITING):
            step["reason"] = f"begun {_utc(float(event['started']))}"
    return list(steps.values())


def _utc(seconds: float) -> str:
    return time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime(seconds))
