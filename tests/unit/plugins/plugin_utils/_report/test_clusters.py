# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Clusters are asked side by side, and none keeps the others' answers back."""

from __future__ import annotations

import threading
from functools import partial
from typing import Any

from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import KubeError
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.cache import Ref
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.clusters import KINDS, ask

PATIENT = 60.0


class Cluster:
    """An API by its name: `away` from the start, `half` breaks at the pods."""

    closed: list[str] = []  # noqa: RUF012 - one list for the clusters of a test

    def __init__(self, name: str, before: Any = None) -> None:
        if name == "none":
            raise KubeError("No usable Kubernetes credentials in none")
        self.name, self.before = name, before
        self.asked: list[tuple[str, str]] = []

    def __enter__(self) -> Cluster:
        return self

    def __exit__(self, *unused: object) -> None:
        self.closed.append(self.name)

    def get(self, ref: Ref) -> Any:
        return (
            {"data": {"robot1": '{"host": "robot1", "playbook": "update.yml", "started": ""}'}}
            if ref.name == "rosops-outcomes"
            else None
        )

    def objects(self, kind: str, namespace: str = "", labels: str = "", fields: str = "") -> list[Any]:
        if kind == "ConfigMap":
            assert fields == "metadata.name=robot-updates"  # all maps together are megabytes
            return []
        assert namespace == "" and self.name not in self.closed
        if self.before:
            self.before()
        if self.name == "away" or (self.name == "half" and kind == "Pod"):
            raise KubeError("connection refused")
        self.asked.append((kind, labels))
        return [f"{kind} of {self.name}"]


def opened(name: str) -> Any:
    return Cluster(name)


def test_everything_that_is_shown_is_asked_for_once() -> None:
    made: list[Cluster] = []

    def good() -> Any:
        made.append(Cluster("good"))
        return made[0]

    answer = ask({"edge": good}, PATIENT)["edge"]
    assert answer.problem == ""
    assert answer.objects == {kind: [f"{kind} of good"] for kind in KINDS}
    assert made[0].asked == list(KINDS.items())
    assert made[0].closed[-1] == "good"
    assert [run.playbook for run in answer.runs] == ["update.yml"]


def test_a_cluster_that_does_not_answer_keeps_nobody_from_the_others() -> None:
    Cluster.closed.clear()
    given = {"a": "none", "b": "away", "c": "half", "d": "good"}
    answers = ask({name: partial(opened, api) for name, api in given.items()}, PATIENT)
    assert {name: one.problem for name, one in answers.items()} == {
        "a": "No usable Kubernetes credentials in none",
        "b": "connection refused",
        "c": "connection refused",
        "d": "",
    }
    assert [list(one.objects) for one in answers.values()] == [[], [], ["Node", "Deployment"], list(KINDS)]
    assert sorted(Cluster.closed) == ["away", "good", "half"]


def test_they_are_asked_side_by_side() -> None:
    Cluster.closed.clear()
    meeting = threading.Barrier(3)  # each waits for the others: one after the other this would never end

    def meets() -> Any:
        return Cluster("good", lambda: meeting.wait(PATIENT))

    assert not any(one.problem for one in ask(dict.fromkeys("abc", meets), PATIENT).values())


def test_one_that_never_answers_is_given_up() -> None:
    Cluster.closed.clear()
    end = threading.Event()

    def slow() -> Any:
        return Cluster("slow", lambda: end.wait(PATIENT))

    try:
        answers = ask({"a": slow, "b": partial(opened, "good")}, 0.2)
    finally:
        end.set()
    assert (answers["a"].objects, answers["a"].problem) == ({}, "no answer within 0 s")
    assert list(answers["b"].objects) == list(KINDS)
