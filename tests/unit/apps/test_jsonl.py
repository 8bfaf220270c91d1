# SPDX-License-Identifier: GPL-3.0-or-later
"""The log that outlives its process."""

from __future__ import annotations

import json
import threading
from pathlib import Path

import pytest
from rosops_apps.jsonl import TAIL_BYTES, JsonLinesLog, last_record


def lines(path: Path) -> list[str]:
    return path.read_text(encoding="utf-8").splitlines()


def test_it_is_appended_to_and_its_directory_made(tmp_path: Path) -> None:
    path = tmp_path / "deep" / "log.jsonl"
    assert last_record(path, "n") is None
    for number in range(2):
        log = JsonLinesLog(path)
        log.write({"n": number})
        log.close()
    assert lines(path) == ['{"n":0}', '{"n":1}']
    assert last_record(path, "n") == {"n": 1}


def test_a_torn_line_costs_only_itself(tmp_path: Path) -> None:
    path = tmp_path / "log.jsonl"
    path.write_text('{"n":1}\n{"n":2,"ra', encoding="utf-8")
    assert last_record(path, "n") == {"n": 1}
    log = JsonLinesLog(path)
    log.write({"n": 3})
    log.close()
    assert lines(path) == ['{"n":1}', '{"n":2,"ra', '{"n":3}']
    assert last_record(path, "n") == {"n": 3}


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", None),
        ("\n\n", None),
        ("[1]\nnull\n7\n", None),
        ('{"n":"7"}\n{"m":1}\n', None),
        ('{"n":5}\n{"n":3}\n', {"n": 5}),  # the older of two processes wrote last
        ('{"n":5,"by":"a"}\n{"n":5,"by":"b"}\n', {"n": 5, "by": "b"}),
        ("\x00\x00\x00\n", None),  # what a crash leaves in some file systems
    ],
)
def test_last_record(tmp_path: Path, text: str, expected: dict[str, object] | None) -> None:
    path = tmp_path / "log.jsonl"
    path.write_text(text, encoding="utf-8")
    assert last_record(path, "n") == expected


def test_only_the_tail_of_a_long_file_is_read(tmp_path: Path) -> None:
    path = tmp_path / "log.jsonl"
    with path.open("w", encoding="utf-8") as file:
        for number in range(20_000):
            file.write(json.dumps({"n": number}) + "\n")
    assert path.stat().st_size > 2 * TAIL_BYTES
    assert last_record(path, "n") == {"n": 19_999}


def test_two_writers_do_not_mix_their_lines(tmp_path: Path) -> None:
    path = tmp_path / "log.jsonl"

    def write(name: str) -> None:
        log = JsonLinesLog(path, sync_seconds=1000)
        for number in range(500):
            log.write({"name": name, "n": number, "filling": "x" * 300})
        log.close()

    threads = [threading.Thread(target=write, args=(name,)) for name in "ab"]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    # A writer that opens the file while the other is in the middle of a write may see a torn end and add an empty line.
    records = [json.loads(line) for line in lines(path) if line]
    assert {name: [r["n"] for r in records if r["name"] == name] for name in "ab"} == {
        "a": list(range(500)),
        "b": list(range(500)),
    }


def test_the_disk_follows_at_most_once_in_its_interval(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    synced: list[float] = []
    now = [0.0]
    log = JsonLinesLog(tmp_path / "log.jsonl", sync_seconds=1.0, clock=lambda: now[0])
    monkeypatch.setattr("os.fdatasync", lambda _file: synced.append(now[0]))
    for tenth in range(1, 31):
        now[0] = tenth / 10
        log.write({"n": tenth})
    assert synced == [1.0, 2.0, 3.0]
    log.close()
    assert len(synced) == 4
