# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""A recorded robot: a sensor, its statistics at the edge, an action's server and client, and a node of no app."""

from __future__ import annotations

from ansible_collections.rosops.fleet.plugins.module_utils._ros.recording import (
    Action,
    App,
    Recording,
    Sent,
    Service,
    Topic,
)

HEADER = f"{'=' * 80}\nMSG: std_msgs/Header\nuint32 seq\ntime stamp\nstring frame_id\n"
TEMPERATURE = Topic(
    "demo/Temperature",
    "aa",
    f"Header header\nuint64 sequence\nfloat64 celsius\n{HEADER}",
    {"/temperature": Sent(500.0)},
    ("/temperature_stats",),
    (("/temperature", "/temperature_stats"),),
)
RECORDING = Recording(
    "robot1",
    {
        "temperature": App("local", ("/temperature",)),
        "temperature-stats": App("remote", ("/temperature_stats", "/arm/helper")),
    },
    ("/loner",),
    {
        "/map": Topic("demo/Map", "bb", "uint8[] data", {"/temperature_stats": Sent(None, latched=True)}),
        "/odd": Topic("demo/Odd", "cc", "this is no definition", {"/loner": Sent(1.0)}),
        "/temperature": TEMPERATURE,
        "/unknown": Topic("demo/Unknown", subscribers=("/loner",)),
        "/work/status": Topic("demo/Status", "ff", "uint8[] list", {"/arm/helper": Sent(None, latched=True)}),
        "/work/goal": Topic("demo/Goal", "dd", "uint8 order", {"/loner": Sent(3.0)}, ("/arm/helper",)),
    },
    {"/home": Service("/arm/helper", "demo/Home", "ee")},
    {"/work": Action("demo/Work", ("/arm/helper",), ("/loner",))},
    {"/speed": "float"},
    {"/speed": 0.5},
)
