# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs the playbooks as an operator does, and kills a control node as a power cut does."""

from __future__ import annotations

import itertools
import json
import os
import re
import subprocess
import sys
import time
import uuid
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from started import kill, marked

CHECKOUT = Path(__file__).resolve().parents[2]
MARK = "ROSOPS_TEST_RUN"
LONGEST = 900.0  # of one playbook, on a busy machine

T = TypeVar("T")


def wait_until(look: Callable[[], T], good: Callable[[T], bool], seconds: float, what: str, pause: float = 0.5) -> T:
    """Look again and again until it is good; the last observation is in the message when it never is."""
    deadline = time.monotonic() + seconds
    while True:
        seen = look()
        if good(seen):
            return seen
        if time.monotonic() >= deadline:
            raise AssertionError(f"{what} not seen within {seconds:g} s; last: {seen}")
        time.sleep(pause)


@dataclass(frozen=True, repr=False)
class Run:
    """A playbook that has ended."""

    name: str
    status: int
    output: str
    report: Mapping[str, Any]
    began: float
    ended: float

    def host(self, name: str) -> Mapping[str, Any]:
        """What the report says of a host."""
        return next((host for host in self.report["hosts"] if host["host"] == name), {})

    @property
    def outcomes(self) -> dict[str, str]:
        """Outcome of each robot."""
        return {host["host"]: host["outcome"] for host in self.report["hosts"] if "robots" in host["groups"]}

    @property
    def changed(self) -> int:
        """How many tasks changed something, over all hosts."""
        return sum(host["counts"].get("changed", 0) for host in self.report["hosts"])

    def must(self, status: int, **outcomes: str) -> Run:
        """Itself: it has ended with this status and, where any is named, with just these outcomes of robots."""
        wanted = (status, outcomes)
        assert (self.status, outcomes and self.outcomes) == wanted, f"wanted {wanted}: {self}"
        return self

    def must_change_nothing(self) -> None:
        """It went well, and none of its tasks changed anything."""
        assert (self.status, self.changed) == (0, 0), self

    def steps(self, robot: str) -> list[Mapping[str, Any]]:
        """The robot's steps."""
        return list(self.host(robot).get("steps") or [])

    def __repr__(self) -> str:
        """What an operator would read first; for messages of failed assertions."""
        hosts = [f"{host['host']}: {host['outcome']}: {host['reason']}" for host in self.report.get("hosts", [])]
        return f"{self.name}: exit status {self.status} after {self.ended - self.began:.0f} s\n" + "\n".join(
            hosts or [self.output[-3000:]]
        )


class Running:
    """A playbook that runs in the background."""

    def __init__(self, command: list[str], environment: dict[str, str], log: Path, report: Path) -> None:
        self.mark = uuid.uuid4().hex
        self.began = time.time()
        self._log, self._report = log, report
        self._name = f"{log.stem}"
        with log.open("wb") as output:
            self._process = subprocess.Popen(  # noqa: S603
                command,
                cwd=CHECKOUT,
                env={**environment, MARK: self.mark},
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )

    @property
    def output(self) -> str:
        return self._log.read_text(encoding="utf-8", errors="replace")

    def wait_for(self, pattern: str, seconds: float = LONGEST) -> None:
        """Until its output has the pattern."""
        searched = re.compile(pattern, re.MULTILINE)

        def look() -> str:
            ended = self._process.poll()
            text = self.output
            assert ended is None or searched.search(text), f"ended ({ended}) without {pattern!r}:\n{text[-3000:]}"
            return text

        wait_until(look, lambda text: bool(searched.search(text)), seconds, f"{pattern!r} in {self._log}", pause=0.02)

    def kill(self) -> None:
        """As if the control node had lost its power: SIGKILL to all that runs there on behalf of the playbook.

        Ansible's workers are sessions of their own, so the process group alone is not all of it.
        """
        kill(lambda: marked(MARK, self.mark))
        self._process.wait(timeout=30)

    def finish(self, seconds: float = LONGEST) -> Run:
        """Wait for its end."""
        try:
            status = self._process.wait(timeout=seconds)
        except subprocess.TimeoutExpired:
            self.kill()
            raise AssertionError(f"{self._name} ran for more than {seconds:g} s:\n{self.output[-3000:]}") from None
        assert "[WARNING]: fleet_report: " not in self.output, f"the report is incomplete:\n{self.output[-3000:]}"
        report = json.loads(self._report.read_text(encoding="utf-8")) if self._report.exists() else {"hosts": []}
        return Run(self._name, status, self.output, report, self.began, time.time())


class Playbooks:
    """The collection's playbooks against one inventory."""

    def __init__(self, inventory: Path, directory: Path) -> None:
        self.inventory = inventory
        self.directory = directory
        directory.mkdir(parents=True, exist_ok=True)
        self._numbers = itertools.count(1)

    def start(self, playbook: str, variables: Mapping[str, Any], *arguments: str, **environ: str) -> Running:
        """Start `playbooks/<playbook>.yml`; variables go in as a file of JSON, so that types stay types."""
        stem = self.directory / f"{next(self._numbers):02}-{playbook}"
        given, log, report = stem.with_suffix(".vars.yml"), stem.with_suffix(".log"), stem.with_suffix(".json")
        given.write_text(json.dumps(variables, indent=2), encoding="utf-8")
        report.unlink(missing_ok=True)
        environment = {
            **os.environ,
            "ANSIBLE_CONFIG": str(CHECKOUT / "ansible.cfg"),
            "ANSIBLE_NOCOLOR": "1",
            "ANSIBLE_FORCE_COLOR": "0",
            "ROSOPS_FLEET_REPORT": str(report),
            "PYTHONUNBUFFERED": "1",  # ansible-playbook flushes what goes into a file only when it forks
            **environ,
        }
        program = str(Path(sys.executable).parent / "ansible-playbook")
        path = CHECKOUT / "playbooks" / f"{playbook}.yml"
        command = [program, "-i", str(self.inventory), str(path), "-e", f"@{given}", *arguments]
        return Running(command, environment, log, report)

    def run(self, playbook: str, variables: Mapping[str, Any], *arguments: str, **environ: str) -> Run:
        """Run it to its end."""
        return self.start(playbook, variables, *arguments, **environ).finish()
