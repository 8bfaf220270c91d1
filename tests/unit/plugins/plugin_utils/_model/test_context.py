# SPDX-License-Identifier: GPL-3.0-or-later
"""A robot's defaults, and its way through a fact."""

from __future__ import annotations

import dataclasses
import json
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.app import File, Port
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.context import Robot
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.keys import plain, read
from ansible_collections.rosops.fleet.tests.unit.robots import robot

APP = {"name": "talker", "image": "example.org/talker:1.0"}


def test_every_field_survives() -> None:
    """Each one away from its default, so that none can be lost and filled in again."""
    made = robot(
        {
            **APP, "handoff": "replace", "node_name": "n", "command": ["c"], "args": ["a"],
            "launch": {"package": "p", "file": ["f", "g"], "args": {"x": True}, "replace": ["m"], "overlap": ["o"]},
            "env": {"A": True, "B": 1, "C": {"secret": "s", "key": "k"}},
            "ports": [{"name": "web", "port": 80, "protocol": "UDP", "host_port": 81, "node_port": 30080}],
            "files": [{"path": "/etc/a", "secret": "s", "mode": "0600"}, {"path": "/etc/b", "content": "b"}],
            "placement": "local", "scope": "fleet", "pattern": "service", "private_names": ["~p"],
            "keep_params": ["p"],
            "volumes": [{"name": "v", "mount_path": "/m", "read_only": True}], "hooks": "none",
            "readiness": {"http": {"port": 80},
                "command": ["r"], "nodes": False, "topics": [{"name": "t", "min_rate": 2}], "services": ["s"],
                "actions": ["a"], "absent": ["x"], "timeout": 1, "interval": 0.1, "consecutive": 2,
            },
            "depends_on": ["o", "o"], "update": {
                "group": "g", "idle": ["i"], "on_busy": "defer",
                "ignore": ["/x/*"], "renamed": {"/a": "/b"}, "rates": {"*": 0},
                "when": [{"topic": "/battery", "field": "percentage", "above": 0.4}],
            },
            "drain_deadline": 0, "liveness_timeout": 0, "termination_grace_period": 1,
            "resources": {"limits": {"cpu": 1}}, "devices": ["/dev/x"], "host_network": True,
            "overrides": {"spec": None}, "host_paths": [{"path": "/data", "read_only": False}],
        },
        mode="standalone",
        volumes=[{"name": "v", "size": "2Gi", "storage_class": "c", "mountPath": "/p", "access_mode": "ReadOnlyMany"}],
        master={
            "mode": "external", "image": "i", "uri": "http://x:1", "placement": "remote", "overrides": {"a": 1},
            "goal_forwarding": False, "keeper_overrides": {"b": 2},
        },
        observability={"enabled": True, "ros_metrics": False, "prometheus": {"enabled": True}},
        update_when=[{"topic": "/cmd_vel", "quiet": 5}],
        update_windows=[{"days": ["mon"], "from": "22:00", "to": "05:30"}],
        quota={"pods": 2},
        limits={"max": {"cpu": 2}},
        pod_security="baseline",
        edge_host_access=True,
        admits=["192.0.2.0/24"],
        pull_secrets=[{"name": "login", "registry": "r", "username": "u", "password": "hush"}],
    )  # fmt: skip
    made = dataclasses.replace(made, old_labels=("talker",))
    fact = json.loads(json.dumps(plain(made)))
    assert read(Robot, fact) == made
    app = made.apps[0]
    assert app.launch is not None
    for item in (made, app, app.launch, app.readiness, app.update, made.master, made.volumes[0], made.observability):
        for field in dataclasses.fields(item):
            assert getattr(item, field.name) != field.default, field.name
    assert made.apps[0].depends_on == ("o",)
    assert made.apps[0].env == {"A": "true", "B": "1", "C": {"secret": "s", "key": "k"}}
    assert made.apps[0].ports == (Port("web", 80, "UDP", 81, 30080),)
    assert made.apps[0].files == (File("/etc/a", "", "s", "a", "0600"), File("/etc/b", "b"))
    assert "hush" not in json.dumps(fact)


@pytest.mark.parametrize("nothing", [None, ""])
def test_null_and_the_empty_text_stand_for_the_default(nothing: Any) -> None:
    master = dict.fromkeys(("mode", "image", "uri", "placement", "overrides"), nothing)
    assert robot({**APP, "handoff": nothing}, master=master) == robot(APP)
