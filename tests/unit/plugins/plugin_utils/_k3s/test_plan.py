# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What is done about k3s in each state that a host can be in."""

from __future__ import annotations

import copy
import hashlib
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._k3s import plan as _k3s_plan

CONFIG = {"path": "/etc/rancher/k3s/config.yaml", "content": "a: 1\n", "mode": "0600", "secret": False}
DIGEST = hashlib.sha256(b"a: 1\n").hexdigest()
NOW: dict[str, Any] = {
    "version": "v1.34.2+k3s1",
    "files": {
        CONFIG["path"]: {"exists": True, "sha256": DIGEST, "mode": "0600"},
        "/usr/local/bin/k3s": {"exists": True, "sha256": "binary", "mode": "0755"},
    },
    "images": {"k3s-airgap-images-amd64-0123456789ab.tar": 99, ".cache.json": 2},
    "service": {"active": "active", "enabled": True, "reload": False, "installed": True},
    "stale": False,
    "ready": True,
    "data": True,
    "tokens": {"server": "same", "agent": "same"},
}
WANTED: dict[str, Any] = {
    "init": True,
    "tokens": ["token", "agent-token"],
    "files": [CONFIG],
    "checksum": "binary",
    "version": "v1.34.2+k3s1",
    "archive": {"name": "k3s-airgap-images-amd64-0123456789ab.tar", "size": 99},
    "kubeconfig": {"given": True, "right": True},
}


def planned(now: dict[str, Any], wanted: dict[str, Any]) -> dict[str, Any]:
    """The plan for a ready host after changes; `a__b` reaches into a."""
    both = copy.deepcopy(NOW), copy.deepcopy(WANTED)
    for facts, changes in zip(both, (now, wanted)):
        for path, value in changes.items():
            *parents, last = path.split("__")
            place = facts
            for parent in parents:
                place = place[parent]
            place[last] = value
    return _k3s_plan.plan(*both)


def test_a_ready_host_is_left_alone() -> None:
    assert planned({}, {})["any"] is False


@pytest.mark.parametrize(
    ("now", "wanted", "expected"),
    [
        ({"stale": True}, {}, {"start": True, "state": "restarted", "kubeconfig": True}),
        ({"service__active": "failed"}, {}, {"start": True, "state": "started"}),
        ({"service__active": "activating", "stale": True, "ready": False}, {}, {"start": True, "state": "restarted"}),
        ({"service__active": "activating", "ready": False}, {}, {"start": False, "wait": True, "kubeconfig": False}),
        ({"service__enabled": False}, {}, {"start": True, "state": "started"}),
        ({}, {"checksum": "newer"}, {"binary": True, "state": "restarted", "wait": True}),
        ({}, {"checksum": ""}, {"binary": False, "any": False}),
        ({}, {"checksum": "", "version": "v1.34.3+k3s1"}, {"binary": True, "state": "restarted"}),
        ({"tokens__server": "restore"}, {}, {"tokens": ["token"], "state": "restarted"}),
        ({"tokens__agent": "absent"}, {}, {"tokens": ["agent-token"]}),
        ({"data": False}, {}, {"tokens": [], "any": False}),
        ({"data": False}, {"init": False, "tokens": ["agent-token"]}, {"tokens": ["agent-token"]}),
        ({"images": {}}, {}, {"archive": True, "start": False, "any": True}),
        ({"images": {"k3s-airgap-images-amd64-0123456789ab.tar": 5}}, {}, {"archive": True}),
        ({"images": {}}, {"archive": {"name": "", "size": 0}}, {"archive": False, "any": False}),
        ({}, {"kubeconfig__right": False}, {"kubeconfig": True, "start": False, "wait": False}),
        ({"stale": True}, {"kubeconfig__given": False}, {"kubeconfig": False}),
        ({}, {"files": [{**CONFIG, "content": "a: 2\n"}]}, {"start": True, "state": "restarted"}),
        ({}, {"files": [{**CONFIG, "content": ""}]}, {"start": True, "state": "restarted"}),
    ],
)
def test_what_is_done(now: dict[str, Any], wanted: dict[str, Any], expected: dict[str, Any]) -> None:
    found = planned(now, wanted)
    assert {key: found[key] for key in expected} == expected


def test_only_files_that_differ_are_written() -> None:
    def file(path: str, content: str, secret: bool = False) -> dict[str, Any]:
        return {"path": path, "content": content, "mode": "0600", "secret": secret}

    def there(content: str, mode: str = "0600") -> dict[str, Any]:
        return {"exists": True, "sha256": hashlib.sha256(content.encode()).hexdigest(), "mode": mode}

    gone = {"exists": False, "sha256": "", "mode": ""}
    wanted = [
        file("/same", "a"),
        file("/new", "b"),
        file("/mode", "c"),
        file("/s", "d", True),
        file("/old", ""),
        file("/no", ""),
    ]
    found = {
        "/same": there("a"),
        "/new": gone,
        "/mode": there("c", "0644"),
        "/s": there("x"),
        "/old": there("y"),
        "/no": gone,
    }
    changes = _k3s_plan.file_changes(wanted, found)
    assert [f["path"] for f in changes["open"]] == ["/new", "/mode"]
    assert [f["path"] for f in changes["secret"]] == ["/s"]
    assert changes["remove"] == ["/old"]
