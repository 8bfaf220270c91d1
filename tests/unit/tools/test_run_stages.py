# SPDX-License-Identifier: GPL-3.0-or-later
"""Stages and lanes: what runs, what does not, and what is said of it."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

import pytest
from imports import loaded

run_stages = loaded(Path(__file__).resolve().parents[2] / "run_stages.py")

# A stage waits for those that its name has after a plus sign: lanes that ran one after the other would never end.
STAGE = """
import pathlib, sys, time
here, name = pathlib.Path(sys.argv[1]), sys.argv[2]
word, _plus, other = name.partition("+")
(here / word).touch()
end = time.monotonic() + 60
while other and not (here / other).exists():
    assert time.monotonic() < end, "alone"
    time.sleep(0.01)
print(f"{word} begins", flush=True)
print(f"{word} ends")
sys.exit(word.startswith(("bad", "setup")) and 1)
"""


# Deaf to SIGTERM, in a session of its own, and nobody's child when its stage has ended.
LEFT = """
import pathlib, signal, subprocess, sys, tempfile
deaf = "import signal, time; signal.signal(signal.SIGTERM, signal.SIG_IGN); print(flush=True); time.sleep(600)"
started = subprocess.Popen([sys.executable, "-c", deaf], stdout=subprocess.PIPE, start_new_session=True)
started.stdout.readline()
pathlib.Path(sys.argv[1]).write_text(tempfile.mkdtemp())
"""


@pytest.fixture(autouse=True)
def _apart(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """From the user's cache, and from podman, which takes its time to say what there is."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr("remains._podman", lambda _words: [])


def staged(tmp_path: Path, *words: str, files: Mapping[str, str] = MappingProxyType({})) -> int:
    here = tmp_path / "seen"
    here.mkdir(exist_ok=True)
    command = (sys.executable, "-c", STAGE, str(here))
    return int(run_stages.main(list(words), command, tmp_path / "logs", read=lambda: files))


def table(output: str) -> dict[str, str]:
    lines = output.partition("=== stages\n")[2].splitlines()[:-2]
    found = re.findall(r"^(\S+) +(.+?) +[0-9.]+ s +[0-9.]+ s of CPU$", "\n".join(lines), re.MULTILINE)
    return {name: verdict for name, verdict in found if name != "nothing-left"}


def test_lanes_run_side_by_side(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert staged(tmp_path, "--first", "a", "--lane", "b+c", "e+d", "--lane", "c+b", "d+e") == 0
    printed = capsys.readouterr().out
    assert printed.splitlines()[-1] == "6 passed, 0 failed"
    assert table(printed) == dict.fromkeys(["a", "b+c", "e+d", "c+b", "d+e"], "passed")
    for name in "abcde":  # whole, whatever else was printed meanwhile
        assert f"\n{name} begins\n{name} ends\n" in printed
    assert (tmp_path / "logs" / "a.log").read_text() == "a begins\na ends\n"


def test_the_first_lane_helps_when_it_is_through(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`b` ends only once `d` has begun, which comes after it in its own lane."""
    assert staged(tmp_path, "--lane", "a", "--lane", "b+d", "c", "d") == 0
    assert table(capsys.readouterr().out) == dict.fromkeys(["a", "b+d", "c", "d"], "passed")


def test_a_stage_runs_with_the_niceness_that_is_right_as_it_begins(tmp_path: Path) -> None:
    told = iter([19, 0])
    stages = run_stages.Stages(
        [sys.executable, "-c", "import os; print(os.nice(0))"],
        tmp_path,
        {},
        run_stages.Passed(tmp_path, dict),
    )
    assert [one.verdict for one in stages.lane(["a", "b"], lambda: next(told))] == ["passed", "passed"]
    assert [int((tmp_path / f"{name}.log").read_text()) - os.nice(0) for name in "ab"] == [19 - os.nice(0), 0]


def test_a_failed_stage_stops_no_other_and_has_no_time(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert staged(tmp_path, "--lane", "bad", "b", "--lane", "c") == 1
    printed = capsys.readouterr().out
    assert table(printed) == {"bad": "FAILED", "b": "passed", "c": "passed"}
    assert printed.splitlines()[-1] == "3 passed, 1 failed"
    assert "c ends\n=== c passed" in printed
    assert "=== bad: why it failed\nbad begins\nbad ends\n=== stages\n" in printed
    kept = json.loads((tmp_path / "logs" / "times.json").read_text())
    assert {name: seconds < 20 for name, seconds in kept["stages"].items()} == {"b": True, "c": True}
    assert kept["whole"] is None


def test_what_a_stage_leaves_is_taken_away_and_makes_the_run_red(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    place = tmp_path / "place"
    assert run_stages.main(["--lane", "a"], (sys.executable, "-c", LEFT, str(place)), tmp_path / "logs", 0.5) == 1
    printed = capsys.readouterr().out
    found = re.search(r"^process (\d+): .*SIG_IGN", printed, re.MULTILINE)
    assert found is not None
    process = Path(f"/proc/{found[1]}/cmdline")
    assert not process.exists() or process.read_bytes() == b""  # ended, and perhaps nobody has asked for its status
    assert "=== nothing-left: why it failed\n" in printed
    assert printed.splitlines()[-1] == "1 passed, 1 failed"
    assert not Path(place.read_text()).parent.exists()


def test_a_stage_is_not_run_again_with_the_files_with_which_it_passed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    files = {"docs/a.md": "1", "plugins/b.py": "1"}

    def verdicts(*words: str) -> dict[str, str]:
        staged(tmp_path, *words, "--lane", "artifacts", "docs", "test-ros", "bad", "lint", files=files)
        return table(capsys.readouterr().out)

    ran = {"artifacts": "passed", "docs": "passed", "test-ros": "passed", "bad": "FAILED", "lint": "passed"}
    before = dict.fromkeys(["docs", "test-ros", "lint"], run_stages.BEFORE)
    assert verdicts() == ran
    assert verdicts() == {**ran, **before}
    files["docs/a.md"] = "2"  # which the nodes of test-ros know nothing of
    assert verdicts() == {**ran, "test-ros": run_stages.BEFORE}
    assert verdicts("--fresh") == ran
    assert verdicts() == {**ran, **before}
    files.clear()  # nobody can tell
    assert verdicts() == ran


def test_what_was_changed_while_it_ran_is_run_again(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    states = iter([{"a": "1"}, {"a": "2"}, {"a": "2"}])
    command = (sys.executable, "-c", "")
    for _run in range(2):
        run_stages.main(["--lane", "lint"], command, tmp_path / "logs", read=lambda: next(states, {"a": "2"}))
        assert table(capsys.readouterr().out) == {"lint": "passed"}


def test_why_a_stage_failed_is_what_pytest_says() -> None:
    output = """\
=== FAILURES ===
    assert 1 == 2
E   assert 1 == 2
\x1b[31m  │     - 'E       AssertionError: as Molecule prints\x1b[0m
  │       what Ansible wraps'
  │     - nothing of it
    - 'E       and where it draws no line
        to its end'
FAILED tests/update/test_1.py::test_it[case] - assert 1 == 2
  | - FAILED tests/update/test_1.py::test_other - AssertionError
make: *** [molecule-update] Error 2"""
    lines = [line.replace("\x1b[31m", "").replace("\x1b[0m", "") for line in output.splitlines()]
    assert run_stages.reasons(output) == tuple(lines[2:5] + lines[6:10])


@pytest.mark.parametrize(
    ("words", "left"),
    [
        (("--first", "setup-tests", "--lane", "a", "--lane", "b"), {"a": "not run", "b": "not run"}),
        (("--lane", "setup-tests", "a", "--lane", "b"), {"a": "not run", "b": "passed"}),
    ],
)
def test_what_was_not_prepared_is_not_run(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: tuple[str, ...], left: dict[str, str]
) -> None:
    assert staged(tmp_path, *words) == 1
    assert table(capsys.readouterr().out) == {"setup-tests": "FAILED", **left}


def test_ended_from_outside_it_begins_nothing_more(tmp_path: Path) -> None:
    script = (
        f"import sys; sys.path.insert(0, {str(run_stages.CHECKOUT / 'tests')!r}); import pathlib, run_stages\n"
        f"stage = (sys.executable, '-c', 'import time; print(0, flush=True); time.sleep(60)')\n"
        f"run_stages.main(['--lane', 'a', 'b'], stage, pathlib.Path({str(tmp_path)!r}))\n"
    )
    with subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True) as running:  # noqa: S603
        assert running.stdout is not None
        assert running.stdout.readline() == "=== a begins\n"
        running.send_signal(signal.SIGTERM)
        assert running.wait(timeout=60) == 128 + signal.SIGTERM
    assert not (tmp_path / "b.log").exists()
