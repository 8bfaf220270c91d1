# SPDX-License-Identifier: GPL-3.0-or-later
"""When a robot may be changed."""

from __future__ import annotations

import json
from datetime import datetime
from typing import Any
from zoneinfo import ZoneInfo

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._step.windows import DAYS
from ansible_collections.rosops.fleet.plugins.module_utils._step.windows import Windows as KeptWindows
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.windows import Windows

BERLIN = "Europe/Berlin"
NIGHT = {"days": ["mon", "fri"], "from": "22:00", "to": "05:30"}
NOON = {"from": "12:00", "to": "13:00"}
SUNDAY = {"days": ["sun"], "from": "00:00", "to": "24:00"}


def seconds(text: str, zone: str = BERLIN) -> float:
    return datetime.fromisoformat(text).replace(tzinfo=ZoneInfo(zone)).timestamp()


def opens(now: str, *spans: dict[str, Any], zone: str = BERLIN) -> str:
    """As the zone's clock shows it; empty where it is open now."""
    wall = seconds(now, zone)
    found = Windows(spans, zone).opens_at(wall)
    assert found >= wall
    return "" if found == wall else datetime.fromtimestamp(found, ZoneInfo(zone)).isoformat(" ")[:16]


@pytest.mark.parametrize(
    ("now", "spans", "opening"),
    [
        ("2026-11-23 12:00", [], ""),
        ("2026-11-23 21:59:59", [NIGHT], "2026-11-23 22:00"),  # a Monday
        ("2026-11-23 22:00", [NIGHT], ""),
        ("2026-11-24 05:29:59", [NIGHT], ""),  # of the day before
        ("2026-11-24 05:30", [NIGHT], "2026-11-27 22:00"),
        ("2026-11-28 04:00", [NIGHT], ""),
        ("2026-11-29 04:00", [NIGHT], "2026-11-30 22:00"),
        ("2026-11-29 04:00", [NIGHT, NOON], "2026-11-29 12:00"),
        ("2026-11-29 12:59", [NIGHT, NOON], ""),
        ("2026-11-29 00:00", [SUNDAY], ""),
        ("2026-11-29 23:59:59", [SUNDAY], ""),
        ("2026-11-30 00:00", [SUNDAY], "2026-12-06 00:00"),
        ("2026-11-28 07:00", [{"from": "06:00", "to": "06:00"}], ""),  # all day
        ("2026-11-28 05:00", [{"days": [], "from": "24:00", "to": "01:00"}], "2026-11-29 00:00"),
    ],
)
def test_the_next_window(now: str, spans: list[dict[str, Any]], opening: str) -> None:
    assert opens(now, *spans) == opening


def test_the_clock_of_the_zone_counts() -> None:
    wall = seconds("2026-11-23 12:30", "UTC")
    assert Windows((NOON,), "UTC").opens_at(wall) == wall
    assert Windows((NOON,), BERLIN).opens_at(wall) == seconds("2026-11-24 12:00")
    assert Windows((NOON,), BERLIN).told(seconds("2026-11-24 12:00")) == "2026-11-24 12:00 (Europe/Berlin)"


def test_when_clocks_are_turned() -> None:
    """In Berlin 02:00 to 03:00 is left out on 2026-03-29, and comes twice on 2026-10-25."""
    gone = {"from": "02:30", "to": "03:00"}
    assert opens("2026-03-29 01:59", gone) == "2026-03-30 02:30"
    assert opens("2026-03-29 01:59", {**gone, "days": ["sun"]}) == "2026-04-05 02:30"
    night = Windows(({"from": "01:00", "to": "04:00"},), BERLIN)
    for day, hours in (("2026-03-28", 3), ("2026-03-29", 2), ("2026-10-25", 4)):
        start = seconds(f"{day} 01:00")
        assert night.opens_at(start + hours * 3600 - 1) == start + hours * 3600 - 1
        assert night.opens_at(start + hours * 3600) > start + hours * 3600


ZONES = [BERLIN, "America/Sao_Paulo", "Australia/Lord_Howe", "Africa/Casablanca", "Asia/Kolkata", "UTC"]
SPANS = [NIGHT, {"from": "01:30", "to": "02:15"}, {"days": ["sun"], "from": "02:30", "to": "03:30"}]


@pytest.mark.parametrize("zone", ZONES)
@pytest.mark.parametrize("number", range(len(SPANS)))
def test_the_keeper_knows_them_without_a_database_of_zones(zone: str, number: int) -> None:
    """Around each turn of the clock, those of three years with a span each."""
    span: Any = SPANS[number]
    ours = Windows((span,), zone)
    told = json.loads(json.dumps(ours.kept))
    keepers = KeptWindows(told["spans"], told["zone"], told["turns"])
    turns = [float(since) for since, _offset in told["turns"]]
    assert len(turns) > 40 or zone in ("America/Sao_Paulo", "Asia/Kolkata", "UTC")
    around = [turn for at, turn in enumerate(turns) if at // 2 % len(SPANS) == number] or turns
    for wall in [turn + minutes * 60.0 for turn in around for minutes in range(-180, 180, 30)]:
        opens_at, days = ours.opens_at(wall), span.get("days", DAYS)
        shown = datetime.fromtimestamp(opens_at, ZoneInfo(zone))
        assert opens_at == wall or (f"{shown:%H:%M}" == span["from"] and DAYS[shown.weekday()] in days)
        assert (keepers.opens_at(wall), keepers.told(opens_at)) == (opens_at, f"{shown:%Y-%m-%d %H:%M} ({zone})")


def test_who_has_no_windows_is_told_of_no_clock() -> None:
    assert Windows(zone=BERLIN).kept == {"spans": (), "zone": BERLIN, "turns": ()}
