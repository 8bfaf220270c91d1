# SPDX-License-Identifier: GPL-3.0-or-later
"""Users' dashboards, with all errors at once."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability.files import (
    LARGEST,
    Dashboard,
    checked,
    read_dashboards,
)


def page(uid: Any = "arm", title: Any = "Arm", **more: Any) -> str:
    return json.dumps({"id": 3, "uid": uid, "title": title, "panels": [], **more})


def good(content: str) -> Dashboard:
    (found,) = checked([("arm.json", content.encode())])
    return found


def refused(*files: tuple[str, str]) -> list[str]:
    """The problems as lines."""
    with pytest.raises(SpecError) as raised:
        checked((path, content.encode()) for path, content in files)
    return str(raised.value).splitlines()[1:]


def test_a_good_dashboard_comes_back_ready_to_apply() -> None:
    found = good("\ufeff" + page("Arm_Left", " Arm (ü) "))
    assert found[:3] == ("arm-left", "Arm_Left", "Arm (ü)")
    assert json.loads(found.json) == {"id": None, "uid": "Arm_Left", "title": " Arm (ü) ", "panels": []}
    assert "\n" not in found.json
    assert "ü" in found.json
    assert good(page("___")).name == "dashboard"  # a uid of signs alone


@pytest.mark.parametrize(
    ("content", "parts"),
    [
        ("{", ["a.json", "is no JSON", "line 1"]),
        ("[]", ["holds a list", "one JSON object"]),
        (page(uid=None), ["a.json: uid: is missing", "1 to 40"]),
        (page(uid=""), ["uid: is missing"]),
        (page(uid="has space"), ["uid: is 'has space'"]),
        (page(uid="x" * 41), ["uid: is 'xxx"]),
        (page(uid=7), ["uid: is the number 7"]),
        (page(uid="a\n"), ["uid: is 'a"]),
        (page(title=None), ["a.json: title: is missing"]),
        (page(title="  "), ["title: is '  '"]),
        (page(title=["x"]), ["title: is a list"]),
        (page(__inputs=[{"name": "DS"}]), ["__inputs: asks for data sources", "Export for sharing externally"]),
    ],
)
def test_what_grafana_cannot_take_is_named_with_what_it_can(content: str, parts: list[str]) -> None:
    (line,) = refused(("a.json", content))
    assert [part for part in parts if part not in line] == []


def test_every_problem_of_every_file_is_told_at_once() -> None:
    files = {"a.json": "{", "b.json": page(uid="", title=""), "c.json": page(), "d.json": page(title="D")}
    lines = refused(*files.items())
    assert [line.strip().partition(": ")[0] for line in lines] == ["a.json", "b.json", "b.json", "d.json"]
    with pytest.raises(SpecError) as raised:
        checked([("a.json", b"{")])
    assert raised.value.details["errors"][0]["path"] == "a.json"


def test_uids_names_and_titles_are_each_given_once() -> None:
    (line,) = refused(("a.json", page()), ("b.json", page(title="B")))
    assert line.startswith("  b.json: uid: 'arm' is too much like 'arm', the uid of a.json; allowed: a uid of its own")
    (line,) = refused(("a.json", page("arm_1")), ("b.json", page("ARM-1", "B")))
    assert "'ARM-1' is too much like 'arm_1', the uid of a.json" in line
    (line,) = refused(("a.json", page()), ("b.json", page("b", "aRM ")))
    assert "'aRM' is the title of a.json, too" in line


def test_the_size_is_that_of_the_configmap_to_the_byte() -> None:
    room = LARGEST - len("arm.json") - len(good(page(description="")).json)
    fits = json.dumps(json.loads(page(description="ü" * (room // 2) + "x" * (room % 2))), indent=8)
    assert len(fits.encode()) > LARGEST  # its spaces and escapes are not what counts
    assert good(fits)
    (line,) = refused(("a.json", page(description="x" * (room + 1))))
    assert f"is {LARGEST + 1} bytes" in line


def test_it_reads_files_from_a_base_and_puts_the_own_first(tmp_path: Path) -> None:
    (tmp_path / "arm.json").write_text(page(), "utf-8")
    own = {"own.json": page("rosops-a", "A")}
    found = read_dashboards(["arm.json", "arm.json"], own, str(tmp_path))
    assert [(one.name, one.uid, one.title) for one in found] == [("arm", "arm", "Arm")]
    (tmp_path / "arm.json").write_text(page("rosops-a"), "utf-8")
    with pytest.raises(SpecError, match=r"arm\.json: uid: 'rosops-a' is .*, the uid of own\.json"):
        read_dashboards(["arm.json"], own, str(tmp_path))


def test_it_tells_what_cannot_be_read_with_the_rest(tmp_path: Path) -> None:
    (tmp_path / "latin.json").write_bytes(b'{"uid": "\xe4"}')
    (tmp_path / "bad.json").write_text("{", "utf-8")
    with pytest.raises(SpecError) as raised:
        read_dashboards(["gone.json", "latin.json", "bad.json"], {}, str(tmp_path))
    for part in ("gone.json: No such file", "latin.json: is no JSON", "bad.json: is no JSON"):
        assert part in str(raised.value)
