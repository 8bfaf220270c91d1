# SPDX-License-Identifier: GPL-3.0-or-later
"""A whole dashboard: panels, variables, the marks of updates and the links between the dashboards."""

from __future__ import annotations

from collections.abc import Sequence

from .panels import LOKI, SCHEMA_VERSION, Json, label_variable, placed, source_variable

PREFIX = "rosops-"
HEIGHTS = {"stat": 4, "timeseries": 8, "state-timeline": 8, "table": 9, "logs": 12}

# The keeper prints a line for each outcome of an update; of an earlier collection a pod of its own does. Its `app` is
# the updated one, the stream's is the pod's.
UPDATE_LINES = (
    '{app=~"ros-keeper|ros-exporter", robot=~"$robot"} |= `"event": "update"`'
    ' | json event="event", id="id", updated="app", outcome="outcome", reason="reason", from="from", to="to"'
    ' | event="update"'
)

# What most queries choose by.
OF_ROBOT = 'robot=~"$robot"'
SENT = f'ros_topic_messages_total{{{OF_ROBOT}, direction="out"}}'
DISKS = 'fstype!~"tmpfs|ramfs|squashfs"'
CARDS = 'device!~"lo|veth.*"'

# Where cells of tables lead. What an alert's rule says of its runbook is no label, but its page has the alert's name.
VALUE = "${__value.raw}"
TO_ROBOT = ("This robot", f"/d/{PREFIX}robot?var-robot={VALUE}&${{__url_time_range}}")
TO_RUNBOOK = ("Runbook", f"https://github.com/rosops/fleet/blob/main/docs/runbooks/{VALUE}.md")

ROBOTS = label_variable("robot", 'label_values(up{robot!=""}, robot)')
ONE_ROBOT = label_variable("robot", 'label_values(up{robot!=""}, robot)', many=False)


def update_marks() -> Json:
    """Updates as marks in every graph, from the logs: the same id as in the metrics and in the report."""
    return {
        "name": "Updates",
        "enable": True,
        "hide": False,
        "iconColor": "purple",
        "datasource": LOKI,
        "expr": UPDATE_LINES,
        "queryType": "range",
        "instant": False,
        "maxLines": 200,
        "titleFormat": "{{robot}}: {{updated}} {{outcome}}",
        "textFormat": "{{from}} to {{to}} {{reason}} (update {{id}})",
        "tagKeys": "robot,updated,outcome",
    }


def page(
    name: str,
    title: str,
    about: str,
    rows: Sequence[Sequence[Json]],
    variables: Sequence[Json] = (),
) -> Json:
    """The dashboard `rosops-<name>`. Its file is <name>.json."""
    own = {"type": "dashboard", "builtIn": 1, "enable": True, "hide": True, "name": "Annotations & Alerts"}
    own = {**own, "datasource": {"type": "grafana", "uid": "-- Grafana --"}, "iconColor": "rgba(0, 211, 255, 1)"}
    links = {"type": "dashboards", "tags": ["rosops"], "asDropdown": True, "title": "Fleet", "includeVars": True}
    return {
        "id": None,
        "uid": PREFIX + name,
        "title": title,
        "description": about,
        "tags": ["rosops"],
        "schemaVersion": SCHEMA_VERSION,
        "version": 1,
        "editable": False,
        "graphTooltip": 1,  # one cross-hair in all graphs
        "refresh": "30s",
        "time": {"from": "now-1h", "to": "now"},
        "timepicker": {},
        "timezone": "browser",
        "fiscalYearStartMonth": 0,
        "weekStart": "",
        "links": [{**links, "keepTime": True, "icon": "external link", "targetBlank": False, "tooltip": "", "url": ""}],
        "annotations": {"list": [own, update_marks()]},
        "templating": {"list": [source_variable("prometheus"), source_variable("loki"), *variables]},
        "panels": placed(rows, HEIGHTS),
    }
