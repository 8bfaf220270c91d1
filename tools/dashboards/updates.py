# SPDX-License-Identifier: GPL-3.0-or-later
"""The dashboard of updates."""

from __future__ import annotations

from .page import OF_ROBOT as R
from .page import ROBOTS, SENT, TO_ROBOT, UPDATE_LINES, page
from .panels import RED_ABOVE, Json, graph, latest, log_query, logs, query, stat, states, table


def latest_updates(which: str = R) -> Json:
    """What became of each app's latest update."""
    info = f"robot_update_info{{{which}}}"
    return table(
        "Latest update of each app",
        {
            "robot": ("Robot", ""),
            "app": ("App", ""),
            "outcome": ("Outcome", ""),
            "handoff": ("Handoff", ""),
            "previous": ("From", ""),
            "revision": ("To", ""),
            "id": ("Id", ""),
        },
        latest(f"max by (robot, app, outcome, handoff, previous, revision, id) ({info})"),
        links={"Robot": TO_ROBOT},
        about="The id is the same in the logs and in the report of the run.",
    )


def updates() -> Json:
    """What updates did, how long they took, and what they did to the apps."""
    by = "by (robot, app)"
    took = (
        f"max {by} (robot_update_finished_timestamp_seconds{{{R}}})"
        f" - max {by} (robot_update_started_timestamp_seconds{{{R}}})"
    )
    rows = [
        [
            stat(
                outcome,
                "none",
                query(f'count(robot_update_info{{{R}, outcome="{outcome}"}}) or vector(0)'),
                steps=steps,
            )
            for outcome, steps in (
                ("updated", (("green", None),)),
                ("running", (("blue", None),)),
                ("deferred-busy", (("green", None), ("orange", 1))),
                ("rolled-back", RED_ABOVE),
                ("failed", RED_ABOVE),
            )
        ],
        [latest_updates()],
        [
            graph("How long it took", "s", query(took, "{{robot}} {{app}}")),
            graph(
                "Phases",
                "s",
                query(f"max by (robot, app, phase) (robot_update_phase_seconds{{{R}}})", "{{robot}} {{app}} {{phase}}"),
                stack=True,
            ),
            graph(
                "Waited for a busy robot",
                "s",
                query(f"max {by} (robot_update_busy_wait_seconds{{{R}}})", "{{robot}} {{app}}"),
            ),
        ],
        [
            graph(
                "Messages sent",
                "cps",
                query(f"sum by (robot, topic) (rate({SENT}[$__rate_interval]))", "{{robot}} {{topic}}"),
            ),
            states("ROS nodes", query(f"max by (robot, node) (ros_node_up{{{R}}})", "{{robot}} {{node}}")),
        ],
        [logs("Updates in the logs", log_query(UPDATE_LINES))],
    ]
    return page("updates", "Updates", "What updates did, and what they did to the apps", rows, [ROBOTS])
