# SPDX-License-Identifier: GPL-3.0-or-later
"""What is done about k3s in each state that a host can be in, and what forbids it."""

from __future__ import annotations

import copy
import hashlib
from dataclasses import replace
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._k3s.plan import (
    file_changes,
    old_archives,
    plan,
    refusal,
    refusals,
    restarts_pods,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._k3s.wanted import Artifacts, HostFile, Wanted

CONFIG = HostFile("/etc/rancher/k3s/config.yaml", "a: 1\n", "0600", secret=False)
DIGEST = hashlib.sha256(b"a: 1\n").hexdigest()
VERSION = "v1.34.2+k3s1"
NOW: dict[str, Any] = {
    "version": VERSION,
    "files": {
        CONFIG.path: {"exists": True, "sha256": DIGEST, "mode": "0600"},
        "/usr/local/bin/k3s": {"exists": True, "sha256": "binary", "mode": "0755"},
    },
    "images": {"k3s-airgap-images-amd64-0123456789ab.tar": 99, ".cache.json": 2},
    "service": {"active": "active", "enabled": True, "reload": False, "installed": True},
    "stale": False,
    "ready": True,
    "data": True,
    "lapsed": False,
    "change": {"unproven": False, "version": ""},
    "tokens": {"server": "same", "agent": "same"},
}
TOKENS, KUBECONFIG = ("token", "agent-token"), "/home/me/edge.yaml"
WANTED = Wanted(True, "https://edge1:6443", (CONFIG,), TOKENS, (), KUBECONFIG)
SOURCE = Artifacts(sha256="binary", archive_name="k3s-airgap-images-amd64-0123456789ab.tar", archive_size=99)
NO_ARCHIVE = Artifacts(sha256="binary")
AGENT: dict[str, Any] = {"init": False, "tokens": ("agent-token",)}
STARTING = {"service__active": "activating"}


def planned(
    now: dict[str, Any], source: Artifacts = SOURCE, version: str = VERSION, right: bool = True, **wanted: Any
) -> dict[str, Any]:
    """The plan for a ready host after changes; in `now`, `a__b` reaches into a."""
    facts = copy.deepcopy(NOW)
    for path, value in now.items():
        *parents, last = path.split("__")
        place = facts
        for parent in parents:
            place = place[parent]
        place[last] = value
    return plan(facts, replace(WANTED, **wanted), source, version, right)


def test_a_file_that_k3s_does_not_read_is_written_and_nothing_is_started_again() -> None:
    file = HostFile("/etc/sysctl.d/ours.conf", "a=1\n", "0644", secret=False)
    gone = {"exists": False, "sha256": "", "mode": ""}
    there = {"exists": True, "sha256": hashlib.sha256(b"a=1\n").hexdigest(), "mode": "0644"}
    found = planned({f"files__{file.path}": gone}, beside=(file,))
    assert (found["beside"], found["any"], found["undone"]) == ([file.path], True, True)
    assert not (found["write"] or found["start"] or found["guarded"] or found["wait"])
    assert not planned({f"files__{file.path}": there}, beside=(file,))["any"]


@pytest.mark.parametrize(
    ("now", "wanted", "expected"),
    [
        (
            {"stale": True},
            {},
            {"start": True, "state": "restarted", "kubeconfig": True, "guarded": True, "restart": True, "works": True}
            | {"unsure": False, "down": False, "any": True, "undone": True},
        ),
        ({}, {}, {"any": False}),  # a ready host is left alone
        ({"service__active": "failed"}, {}, {"start": True, "state": "started"}),
        ({"stale": True, "ready": False}, {}, {"guarded": False, "works": False, "unsure": True, "down": False}),
        ({"ready": False}, {}, {"unsure": False, "any": True, "undone": False}),
        ({"stale": True, "ready": False, "data": False}, {}, {"unsure": False}),
        ({"stale": True, "ready": False, "service__active": "failed"}, {}, {"unsure": False, "down": True}),
        ({"ready": False, "change__unproven": True}, {}, {"unsure": True, "guarded": True, "any": True}),
        ({"stale": True, "data": False}, {}, {"guarded": False}),
        ({"stale": True, "service__active": "inactive"}, {}, {"guarded": False}),
        ({"change__unproven": True}, {}, {"guarded": True, "restart": False, "wait": True, "any": True}),
        # what was cut off has left it stopped
        ({"change__unproven": True, "service__active": "inactive"}, {}, {"guarded": True, "restart": True}),
        # asked for once, and done after that
        ({}, {"rotate": "certificates"}, {"rotate": "certificates", "guarded": True, "restart": True, "undone": False}),
        ({"stale": True}, {"rotate": "token"}, {"any": True, "undone": True}),
        ({"tokens__server": "behind"}, {}, {"tokens": ["token"], "guarded": True, "undone": True}),
        ({**STARTING, "stale": True, "ready": False}, {}, {"start": True, "state": "restarted"}),
        ({**STARTING, "ready": False}, {}, {"start": False, "wait": True, "kubeconfig": False}),
        ({"service__enabled": False}, {}, {"start": True, "state": "started"}),
        ({}, {"source": replace(SOURCE, sha256="newer")}, {"binary": True, "state": "restarted", "wait": True}),
        ({"files__/usr/local/bin/k3s__mode": "0644"}, {}, {"binary": True}),
        ({}, {"source": replace(SOURCE, sha256="")}, {"binary": False, "any": False}),
        ({}, {"source": replace(SOURCE, sha256=""), "version": "v1.34.3+k3s1"}, {"binary": True, "state": "restarted"}),
        ({"tokens__server": "restore"}, {}, {"tokens": ["token"], "state": "restarted"}),
        ({"tokens__agent": "absent"}, {}, {"tokens": ["agent-token"]}),
        # agents that have joined need none
        ({"tokens__agent": "differs"}, {}, {"tokens": ["agent-token"], "guarded": True, "restart": True}),
        ({"data": False}, {}, {"tokens": [], "any": False}),
        ({"data": False}, AGENT, {"tokens": ["agent-token"]}),
        ({}, AGENT, {"any": False}),  # it may have ended
        # a robot that was off for a year, and one that was named; after a run that named it the token is not left to do
        ({"lapsed": True}, AGENT, {"tokens": ["agent-token"], "guarded": True}),
        ({}, {**AGENT, "anew": True}, {"tokens": ["agent-token"], "guarded": True, "any": True, "undone": False}),
        ({"stale": True}, {**AGENT, "anew": True}, {"undone": True}),
        ({**STARTING, "ready": False}, {**AGENT, "anew": True}, {"unsure": False, "guarded": False, "restart": True}),
        ({**STARTING, "ready": False, "lapsed": True}, AGENT, {"unsure": False, "guarded": False, "restart": True}),
        ({"images": {}}, {}, {"archive": True, "start": False, "any": True}),
        ({"images": {"k3s-airgap-images-amd64-0123456789ab.tar": 5}}, {}, {"archive": True}),
        ({"images": {}}, {"source": NO_ARCHIVE}, {"archive": False, "any": False}),
        ({}, {"right": False}, {"kubeconfig": True, "start": False, "wait": False, "guarded": False}),
        ({"stale": True}, {"kubeconfig": ""}, {"kubeconfig": False}),
        ({}, {"files": (replace(CONFIG, content="a: 2\n"),)}, {"start": True, "state": "restarted"}),
        ({}, {"files": (replace(CONFIG, content=""),)}, {"start": True, "state": "restarted"}),
    ],
)
def test_what_is_done(now: dict[str, Any], wanted: dict[str, Any], expected: dict[str, Any]) -> None:
    found = planned(now, **wanted)
    assert {key: found[key] for key in expected} == expected


def test_only_files_that_differ_are_written() -> None:
    def there(content: str, mode: str = "0600") -> dict[str, Any]:
        return {"exists": True, "sha256": hashlib.sha256(content.encode()).hexdigest(), "mode": mode}

    gone = {"exists": False, "sha256": "", "mode": ""}
    contents = {"/same": "a", "/new": "b", "/mode": "c", "/s": "d", "/old": "", "/no": ""}
    files = [HostFile(path, content, "0600", secret=path == "/s") for path, content in contents.items()]
    found = {"/same": there("a"), "/new": gone, "/mode": there("c", "0644"), "/s": there("x"), "/old": there("y")}
    found["/no"] = gone
    assert file_changes(files, found) == {"write": ["/new", "/mode", "/s"], "remove": ["/old"]}


def test_archives_of_other_versions_are_old() -> None:
    names = ["k3s-airgap-images-arm64-0123456789ab.tar.zst", "apps.tar", ".cache.json"]
    now = {"images": dict.fromkeys([*names, SOURCE.archive_name], 1)}
    assert old_archives(now, SOURCE) == names[:1]


# --- what forbids it --------------------------------------------------------------------------------------------------

SOUND: dict[str, Any] = {**NOW, "machine": "x86_64", "other_service": False, "cgroup_refused": False, "foreign": []}
VARIABLES: dict[str, Any] = {
    "k3s_role": "server", "k3s_cluster": "edge", "k3s_server_hosts": ["edge1"], "k3s_install_source": "release",
    "k3s_version": "v1.34.2+k3s1", "k3s_airgap_dir": "", "k3s_token": "", "k3s_config": {}, "k3s_enrol": "",
}  # fmt: skip


@pytest.mark.parametrize(
    ("now", "variables", "words"),
    [
        ({"foreign": ["edge2:6443"]}, {"k3s_enrol": "robot1"}, "edge2:6443 is of another cluster than the one"),
        ({"foreign": ["edge2:6443"]}, {"k3s_enrol": "robot1, edge1"}, ""),
        (
            {"tokens": {"server": "differs", "agent": "same"}},
            {"k3s_token": "another"},
            "k3s_token is not the token that the cluster edge",
        ),
        (
            {"tokens": {"server": "differs", "agent": "same"}},
            {},
            "The token in /etc/rancher/k3s/token is not the one that the cluster edge runs with. Where its rotation",
        ),
        ({"tokens": {"server": "lost", "agent": "same"}}, {}, "not that cluster's tokens in /etc/rancher/k3s"),
        ({"other_service": True}, {}, "It is a k3s agent and is to become a server"),
        ({}, {"k3s_server_hosts": ["edge2", "edge3"]}, "k3s_role is server, but k3s_server_hosts is edge2, edge3"),
        ({}, {"k3s_install_source": "airgap"}, "needs k3s_airgap_dir"),
        ({}, {"k3s_config": {"data-dir": "/mnt/ssd/k3s"}}, "has a data-dir. Leave it out"),
        ({}, {"k3s_config": {"data-dir": "/var/lib/rancher/k3s"}}, ""),
        ({"version": "v1.35.0+k3s1", "change": {"unproven": False, "version": "v1.34.2+k3s1"}}, {}, "is older than"),
        ({"cgroup_refused": True}, {"k3s_version": "v1.35.5+k3s1"}, "which has cgroup v1"),
        ({"machine": "riscv64"}, {}, "no k3s for the architecture riscv64"),
        ({}, {}, ""),  # a sound host, and the way back from what nobody has proven
        ({"version": "v1.35.0+k3s1", "change": {"unproven": True, "version": "v1.34.2+k3s1"}}, {}, ""),
        ({"version": "v1.35.0+k3s1"}, {"k3s_install_source": "airgap", "k3s_airgap_dir": "/srv"}, ""),
    ],
)
def test_each_is_named(now: dict[str, Any], variables: dict[str, Any], words: str) -> None:
    found = list(refusals({**SOUND, **now}, {**VARIABLES, **variables}, "edge1"))
    assert [words in one for one in found] == [True] * bool(words)


def test_all_are_found_at_once() -> None:
    assert len(list(refusals({**SOUND, "machine": "vax", "other_service": True}, VARIABLES, "edge1"))) == 2


@pytest.mark.parametrize(
    ("installed", "wanted", "more", "words"),
    [
        ("", VERSION, {}, ""),
        (VERSION, "", {}, ""),
        (VERSION, VERSION, {}, ""),
        (VERSION, "v1.34.3+k3s1", {}, ""),
        ("a build of our own", VERSION, {}, ""),
        (VERSION, "v1.34.1+k3s1", {}, "k3s v1.34.1+k3s1 is older than v1.34.2+k3s1, which runs there"),
        ("v1.31.1+k3s1", VERSION, {}, "a minor version is skipped"),
        ("v1.32.1+k3s1", VERSION, {}, "Go to a version v1.33.x first"),
        # what nobody has proven is left as it came
        ("v1.34.3+k3s1", VERSION, {"back_to": VERSION}, ""),
        ("v1.34.3+k3s1", "v1.34.1+k3s1", {"back_to": VERSION}, "is older than"),
        # an agent
        (VERSION, "v1.34.3+k3s1", {"servers": ["v1.34.3+k3s1"]}, ""),
        (VERSION, "v1.34.3+k3s1", {"servers": ["v1.34.3+k3s1", VERSION]}, "newer than its cluster's servers (v1.34.2"),
        ("", VERSION, {"servers": ["v1.33.5+k3s1"]}, "Bring the servers to that version first"),
        ("", VERSION, {"servers": ["of our own"]}, ""),
        # a host with cgroup v1
        (VERSION, "v1.34.3+k3s1", {"cgroup_refused": True}, ""),
        (VERSION, "v1.35.5+k3s1", {"cgroup_refused": True}, "k3s v1.35.5+k3s1 does not start on this host"),
        ("", "v1.35.5+k3s1", {"cgroup_refused": True}, "systemd.unified_cgroup_hierarchy=1"),
        ("v1.35.4+k3s1", "v1.35.5+k3s1", {"cgroup_refused": True}, ""),
        (VERSION, "v1.35.5+k3s1", {}, ""),
        (VERSION, "", {"cgroup_refused": True}, ""),
    ],
)
def test_refusals(installed: str, wanted: str, more: dict[str, Any], words: str) -> None:
    found = refusal(installed, wanted, **more)
    assert words in found
    assert bool(found) is bool(words)


@pytest.mark.parametrize(("installed", "wanted", "restarts"), [
    ("v1.30.9+k3s1", "v1.31.0+k3s1", True), (VERSION, "v1.34.9+k3s1", False), (VERSION, "", False),
    ("ours", VERSION, False),
])  # fmt: skip
def test_another_minor_version_may_start_all_containers_again(installed: str, wanted: str, restarts: bool) -> None:
    assert restarts_pods(installed, wanted) is restarts
