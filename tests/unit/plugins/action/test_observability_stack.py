# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The stack of a cluster: what is applied in which order, what is taken away, and what is waited for."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, Iterable, Mapping

import pytest
from ansible_collections.rosops.fleet.plugins.action import _observability_stack as plugin
from ansible_collections.rosops.fleet.plugins.plugin_utils._action.variables import role_options
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.applied import Applied, applied
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.cache import Ref
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.client import ref_of

READY = {"metadata": {"name": "edge1"}, "status": {"conditions": [{"type": "Ready", "status": "True"}]}}
OFF = {"metadata": {"name": "robot1"}, "status": {"conditions": [{"type": "Ready", "status": "Unknown"}]}}


class Cluster:
    """What the API server would keep, and what it was asked."""

    def __init__(self, nodes: list[Mapping[str, Any]]) -> None:
        self.objects: dict[Ref, Mapping[str, Any]] = {}
        self.asked: list[tuple[str, str]] = []
        self._nodes = nodes

    def __enter__(self) -> Cluster:
        return self

    def __exit__(self, *unused: object) -> None:
        """Nothing to close."""

    def get(self, ref: Ref) -> Mapping[str, Any] | None:
        return self.objects.get(ref)

    def nodes(self) -> list[Mapping[str, Any]]:
        return self._nodes

    def apply(self, objects: Iterable[Mapping[str, Any]], dry_run: bool) -> list[Applied]:
        found = []
        for one in objects:
            self.asked.append(("apply", f"{one['kind']} {one['metadata']['name']}"))
            found.append(applied(ref_of(one), self.objects.get(ref_of(one)), one))
            if not dry_run:
                self.objects[ref_of(one)] = one
        return found

    def delete(self, refs: Iterable[Ref], dry_run: bool) -> list[Applied]:
        found = []
        for ref in refs:
            found.append(applied(ref, self.objects.get(ref), None))
            if not dry_run:
                self.objects.pop(ref, None)
        return found


@pytest.fixture(name="waited")
def _waited(monkeypatch: pytest.MonkeyPatch) -> list[set[str]]:
    found: list[set[str]] = []
    monkeypatch.setattr(plugin, "wait_for_rollout", lambda _kube, refs, _settings: found.append({r.kind for r in refs}))
    return found


def run(monkeypatch: pytest.MonkeyPatch, cluster: Cluster, check: bool = False, **given: Any) -> dict[str, Any]:
    monkeypatch.setattr(plugin, "Kube", lambda _auth: cluster)
    defaults = {name: option.get("default") for name, option in role_options("observability").items()}
    task = SimpleNamespace(args={}, check_mode=check, async_val=0, diff=True, environment=[], no_log=False)
    connection = SimpleNamespace(_shell=SimpleNamespace(tmpdir="/unused", env_prefix=lambda **_: ""))
    templar = SimpleNamespace(template=lambda value: value)
    action = plugin.ActionModule(task, connection, None, None, templar)
    result: dict[str, Any] = action.run(task_vars={**defaults, **given, "inventory_hostname": "edge1"})
    return result


def test_all_of_it_is_applied_once_and_waited_for(monkeypatch: pytest.MonkeyPatch, waited: list[set[str]]) -> None:
    cluster = Cluster([READY])
    first = run(monkeypatch, cluster, observability_grafana_admin_password="hush")  # noqa: S106 - no one's
    assert first["changed"]
    assert cluster.asked[:2] == [("apply", "Namespace observability"), ("apply", "Secret grafana-admin")]
    assert waited == [{"Deployment", "DaemonSet", "PersistentVolumeClaim"}]
    assert "aHVzaA" not in str(first["diff"])
    second = run(monkeypatch, cluster)  # the password is the cluster's from now on
    assert (second["changed"], second["diff"]) == (False, [])


def test_check_mode_writes_nothing_and_waits_for_nothing(
    monkeypatch: pytest.MonkeyPatch, waited: list[set[str]]
) -> None:
    cluster = Cluster([READY])
    assert run(monkeypatch, cluster, check=True)["changed"]
    assert (cluster.objects, waited) == ({}, [])


def test_what_every_host_runs_is_not_waited_for_while_one_is_off(
    monkeypatch: pytest.MonkeyPatch, waited: list[set[str]]
) -> None:
    said: list[str] = []
    monkeypatch.setattr(plugin.display, "display", said.append)
    run(monkeypatch, Cluster([READY, OFF]))
    assert waited == [{"Deployment", "PersistentVolumeClaim"}]
    assert said[0].startswith("[edge1] robot1: off")


def test_a_part_that_is_switched_off_is_taken_away_but_not_its_claim(
    monkeypatch: pytest.MonkeyPatch, waited: list[set[str]]
) -> None:
    cluster = Cluster([READY])
    run(monkeypatch, cluster)
    assert run(monkeypatch, cluster, observability_loki_enabled=False)["changed"]
    assert {ref.kind for ref in cluster.objects if ref.name == "loki"} == {"PersistentVolumeClaim"}
    assert len(waited) == 2


def test_a_wrong_setting_is_told_before_anything_is_applied(monkeypatch: pytest.MonkeyPatch) -> None:
    cluster = Cluster([READY])
    result = run(monkeypatch, cluster, observability_profile="robot")
    assert (result["failed"], cluster.asked) == (True, [])
    assert "observability_hub_url" in result["msg"]
    result = run(monkeypatch, cluster, observability_dashboards=["/none.json"])
    assert (result["failed"], cluster.asked) == (True, [])
