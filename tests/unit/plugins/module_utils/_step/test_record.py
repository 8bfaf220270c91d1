# SPDX-License-Identifier: GPL-3.0-or-later
"""The one answer to what a version is: every mark, record, revision and neighbour in the step, and who asks."""

from __future__ import annotations

import json
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._step.record import (
    GOING_BACK,
    INSTALLED,
    ON_TRIAL,
    PROVEN,
    UNKNOWN,
    Record,
    answer,
    record_of,
    soaks,
)
from ansible_collections.rosops.fleet.plugins.module_utils._step.words import SOAKING, UPDATING

APP = "camera"
OLD, THIS, OTHER = "rev1", "rev2", "rev9"
# Of the run that wrote the record, on this revision or copied from another one; of another run; as 0.x wrote it.
MARKS = ("", f"7 {THIS}", f"7 {OLD}", f"7 {OTHER}", f"6 {THIS}", f"6 {OLD}", f"6 {OTHER}", "7", "6")


def deployment(revision: str, mark: str = "", name: str = APP) -> dict[str, Any]:
    return {
        "metadata": {"name": name, "annotations": {UPDATING: mark} if mark else {}},
        "spec": {"template": {"metadata": {"labels": {"rosops.fleet/revision": revision}}}},
    }


def entry(revision: str) -> dict[str, Any]:
    return {"revision": revision, "deployment": deployment(revision)}


def record(*before: str, **contract: Any) -> Record:
    said = {"revision": THIS, "run": "7", "apps": [APP], **contract}
    return record_of({"data": {"contract.json": json.dumps(said), "history.json": json.dumps([*map(entry, before)])}})


ALL = dict.fromkeys
RECORDS: dict[str, tuple[Record | None, dict[str, dict[str, str]]]] = {
    # name: (record, revision of the Deployment -> mark -> answer)
    "nobody has written it down": (None, {one: ALL(MARKS, UNKNOWN) for one in (THIS, OLD)}),
    "somebody spoilt it": (
        record_of({"data": {"contract.json": "[3]", "history.json": "no JSON"}}),
        {one: ALL(MARKS, UNKNOWN) for one in (THIS, OLD)},
    ),
    "only just installed": (record(install=True), {one: ALL(MARKS, INSTALLED) for one in (THIS, OLD, OTHER)}),
    "installed and proven": (
        record(install=True, proven=True),
        {THIS: ALL(MARKS, PROVEN), OLD: ALL(MARKS, UNKNOWN), OTHER: ALL(MARKS, UNKNOWN)},
    ),
    "a new app in a step": (record(), {THIS: ALL(MARKS, ON_TRIAL), OTHER: ALL(MARKS, UNKNOWN)}),
    "in a step": (
        record(OLD),
        {
            THIS: ALL(MARKS, ON_TRIAL),
            OLD: {**ALL(MARKS, PROVEN), f"7 {OLD}": GOING_BACK, "7": GOING_BACK},
            OTHER: ALL(MARKS, UNKNOWN),
        },
    ),
    "proven": (
        record(OLD, proven=True),
        {THIS: ALL(MARKS, PROVEN), OLD: ALL(MARKS, PROVEN), OTHER: ALL(MARKS, UNKNOWN)},
    ),
    # a step that leaves the pod template as it is: the mark alone says which of the two it is
    "in a step to the same revision": (
        record(THIS),
        {THIS: {**ALL(MARKS, PROVEN), f"7 {THIS}": ON_TRIAL, "7": ON_TRIAL}, OTHER: ALL(MARKS, UNKNOWN)},
    ),
    "in a step, as 0.x wrote it": (
        record(OLD, run=""),
        {
            THIS: ALL(MARKS, ON_TRIAL),
            OLD: {**ALL(MARKS, PROVEN), **ALL((f"7 {OLD}", f"6 {OLD}", "7", "6"), GOING_BACK)},
            OTHER: ALL(MARKS, UNKNOWN),
        },
    ),
}
ROWS = [
    pytest.param(found, deployment(revision, mark), expected, id=f"{name}: {revision}, mark {mark or 'none'}")
    for name, (found, table) in RECORDS.items()
    for revision, marks in table.items()
    for mark, expected in marks.items()
]


@pytest.mark.parametrize(("found", "there", "expected"), ROWS)
def test_what_a_version_is(found: Record | None, there: dict[str, Any], expected: str) -> None:
    assert answer(there, {APP: found} if found else {}) == expected


@pytest.mark.parametrize(
    ("other", "expected"),
    [
        ({"proven": True}, PROVEN),  # the run ended between two apps of one step
        ({}, ON_TRIAL),
        ({"proven": True, "run": "6"}, ON_TRIAL),  # an earlier step of the same apps was: this one's is not written yet
        ({"proven": True, "apps": ["lidar"]}, ON_TRIAL),  # a step of its own
    ],
)
@pytest.mark.parametrize("mark", ["", f"7 {THIS}"])
def test_a_step_proves_all_its_apps_at_once(mark: str, other: dict[str, Any], expected: str) -> None:
    apps = [APP, "lidar"]
    records = {APP: record(OLD, apps=apps), "lidar": record(OLD, **{"apps": apps, **other})}
    assert answer(deployment(THIS, mark), records) == expected


def test_a_record_is_read_as_it_was_written() -> None:
    written = record(OLD, ready_timeout=30, apps=[APP, "lidar"], soak=0.5, ends=3, ignore=["/debug"])
    assert (written.ready_timeout, written.soak, written.ends, written.before) == (30.0, 0.5, 3, deployment(OLD))
    assert record_of({"data": written.data()}) == written
    # in a fixed order, so that what says the same is the same, and without what says nothing
    for text in written.data().values():
        assert json.dumps(json.loads(text), sort_keys=True) == text
    assert not {"soak", "ends", "ignore"} & {*json.loads(record(OLD).data()["contract.json"])}
    assert record_of({"data": written.fulfilled().data()}).proven
    assert (record_of(None), record_of({"data": None})) == (Record(), Record())


SOAKED = {"soak": 120.0, "ends": 1}


@pytest.mark.parametrize(
    ("said", "revision", "note", "soaking"),
    [
        (SOAKED, THIS, f"7 {THIS}", True),
        (SOAKED, THIS, "", False),  # somebody took it off
        (SOAKED, THIS, f"6 {THIS}", False),  # brought back by `kubectl rollout undo`
        (SOAKED, OLD, f"7 {THIS}", False),
        (SOAKED, OLD, f"7 {OLD}", False),
        ({"soak": 0.5}, THIS, f"7 {THIS}", True),
        ({}, THIS, f"7 {THIS}", False),
        ({**SOAKED, "proven": True}, THIS, f"7 {THIS}", False),
    ],
)
def test_what_soaks(said: dict[str, Any], revision: str, note: str, *, soaking: bool) -> None:
    there = deployment(revision)
    there["metadata"]["annotations"] = {SOAKING: note} if note else {}
    assert soaks(there, {APP: record(OLD, **said)}) is soaking
    assert soaks(there, {}) is False


@pytest.mark.parametrize(
    "text",
    [
        "", "no JSON", "{}", "[3]", "[" * 100_000, '[{"revision": "x"}]', '[{"deployment": 3}]', '{"ends": Infinity}',
        '{"ready_timeout": "never"}',
    ],
)  # fmt: skip
def test_what_somebody_spoilt_is_not_there(text: str) -> None:
    assert record_of({"data": {"history.json": text, "contract.json": text}}) == Record()


def test_what_was_found_good_has_the_names_of_its_pods_for_keepers_that_know_no_others() -> None:
    contract = {"nodes": ["/a_1a2b3c4d", "/b"], "edges": [["/a_1a2b3c4d", "/t", "/c_99999999"]]}
    found = record(OLD, **contract, ignore=["/debug"])
    assert found.ignore == ("/debug",)
    good = found.found_good(120.0, 2, {"1a2b3c4d": "79d9c6f8b5"})
    assert (good.soak, good.ends) == (120.0, 2)
    said = json.loads(good.data()["contract.json"])
    assert (said["nodes"], said["edges"]) == (
        ["/a_1a2b3c4d_79d9c6f8b5", "/b"], [["/a_1a2b3c4d_79d9c6f8b5", "/t", "/c_99999999"]],
    )  # fmt: skip
    assert record_of({"data": good.data()}) == found.found_good(120.0, 2, {})  # as every reader since has it
