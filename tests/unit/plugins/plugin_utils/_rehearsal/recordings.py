# SPDX-License-Identifier: GPL-3.0-or-later
"""What record.yml keeps of a robot: a sensor, its statistics at the edge, an action's server, nodes of no app."""

from __future__ import annotations

from typing import Any

from ansible_collections.rosops.fleet.plugins.plugin_utils._rehearsal.recording import KIND, VERSION

SENSOR, STATS, HOST = "10.42.0.1", "10.42.1.2", "192.0.2.1"
LATCHED = {"rate": None, "latched": ["/arm/helper"]}


def node(host: str, **more: Any) -> dict[str, Any]:
    return {"uri": f"http://{host}:1/", "pid": 1, **more}


def topic(kind: str, publishers: list[str], subscribers: list[str], **more: Any) -> dict[str, Any]:
    definition = f"uint8 {kind.lower()} # {{{{ no template }}}}"
    told = {"type": f"demo/{kind}", "md5sum": kind.lower(), "definition": definition, "rate": None}
    return {**told, "latched": [], "publishers": publishers, "subscribers": subscribers, **more}


def service(provider: str, **more: Any) -> dict[str, Any]:
    return {"provider": provider, "type": "demo/Home", "md5sum": "home", "up": True, **more}


RECORDING: dict[str, Any] = {
    "kind": KIND,
    "version": VERSION,
    "apps": [
        {"name": "temperature", "placement": "local", "addresses": [SENSOR]},
        {"name": "temperature-stats", "placement": "remote", "addresses": [STATS]},
        {"name": "lidar", "placement": "local", "addresses": [HOST]},
        {"name": "camera", "placement": "local", "addresses": [HOST]},
    ],
    "graph": {
        "nodes": {
            "/temperature_1a2b3c4d": node(SENSOR),
            "/temperature_stats": node(STATS),
            "/arm/helper": node(STATS),
            "/loner": node(HOST),
            "/rosout": node(HOST),
            "/ros_keeper": node(HOST),
            "/gone": node(SENSOR, reachable=False),
        },
        "topics": {
            "/map": topic("Map", ["/arm/helper"], [], **LATCHED),
            "/rosout": topic("Log", ["/loner", "/arm/helper"], ["/rosout"], rate=20.0),
            "/temperature": topic(
                "Temperature", ["/temperature_1a2b3c4d", "/loner"], ["/temperature_stats"], rate=500.0
            ),
            "/unknown": topic("Unknown", ["/loner"], ["/loner"], type="*", md5sum=None),
            "/work/goal": topic("Goal", ["/loner"], ["/arm/helper"], rate=3.0),
            "/work/status": topic("Status", ["/arm/helper"], [], **LATCHED),
        },
        "services": {
            "/home": service("/arm/helper"),
            "/temperature_1a2b3c4d/reset": service("/temperature_1a2b3c4d"),
            "/arm/helper/get_loggers": service("/arm/helper"),
            "/silent": service("/arm/helper", up=False),
        },
        "actions": {"/work": {}},
    },
}
