# SPDX-License-Identifier: GPL-3.0-or-later
"""Jobs as AWX runs them, without AWX: ansible-runner with the command line and the surroundings that a real one used.

Its home is empty, the project is a copy that goes with the job, the inventory a program that tells hosts in any order.
What is cancelled, or silent for too long, gets SIGKILL, all of it at once, as in a container that is killed.
"""

from __future__ import annotations

import contextlib
import itertools
import json
import os
import random
import re
import shutil
import subprocess
import sys
import time
import uuid
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml
from started import kill, marked

CHECKOUT = Path(__file__).resolve().parents[2]
IDLE = 20  # AWX's DEFAULT_JOB_IDLE_TIMEOUT here, in seconds
MARK = "ROSOPS_TEST_JOB"
COLOUR = re.compile(r"\x1b\[[0-9;]*m")
# What a user's project has, as rosops.fleet.new makes it.
CONFIG = """[defaults]
callbacks_enabled = rosops.fleet.fleet_report
[inventory]
any_unparsed_is_failed = True
"""
SCRIPT = """#!{python}
import json
print(json.dumps({inventory!r}))
"""


@dataclass(frozen=True)
class Template:
    """A job template, and what is asked at its launch."""

    playbook: str  # of the collection
    inventory: Mapping[str, Any]  # as `ansible-inventory --list --export` says it
    variables: Mapping[str, Any] = field(default_factory=dict)  # a survey's answers
    # the template's own, which may hold templates and keep their types
    own: Mapping[str, Any] = field(default_factory=dict)
    limit: str = ""
    tags: str = ""
    verbosity: int = 0
    credential: Mapping[str, str] = field(default_factory=dict)  # what it sets in the environment
    name: str = "update"


@dataclass(frozen=True)
class Ended:
    """A job that has ended."""

    status: str  # successful, failed, canceled, timeout (of its silence)
    code: int
    output: str
    artifacts: Mapping[str, Any]
    events: Sequence[Mapping[str, Any]]

    @property
    def outcomes(self) -> dict[str, str]:
        """Of each host, by the artifact that AWX hands on to a workflow's next node."""
        return {host: one["outcome"] for host, one in self.artifacts.get("fleet_outcomes", {}).items()}

    @property
    def silence(self) -> float:
        """The longest time between two events with a text, in seconds."""
        times = [float(event["at"]) for event in self.events if event["stdout"]]
        return max((after - before for before, after in itertools.pairwise(times)), default=0.0)


class Job:
    """One that runs, in a folder that goes with it."""

    def __init__(self, folder: Path, template: Template) -> None:
        self.folder, self.template, self.mark = folder, template, uuid.uuid4().hex
        self.ended: Ended | None = None
        for name in ("cp", "home"):
            (folder / name).mkdir(parents=True)
        for name, text in self._files().items():
            (folder / name).parent.mkdir(exist_ok=True)
            (folder / name).write_text(text)
        (folder / "inventory" / "hosts").chmod(0o700)
        command = [sys.executable, "-m", "ansible_runner", "run", str(folder), "-p", "play.yml", "-i", "job", "-q"]
        self._process = subprocess.Popen(  # noqa: S603 - our own
            [*command, "--cmdline", self._command_line()],
            cwd=folder,
            env={**self._environment(), MARK: self.mark},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )

    def _files(self) -> dict[str, str]:
        """What AWX lays into the folder, each with its text."""
        template = self.template
        environment = {
            "ANSIBLE_HOST_KEY_CHECKING": "False",
            "ANSIBLE_FORCE_COLOR": "True",
            "ANSIBLE_INVENTORY_UNPARSED_FAILED": "True",
            "ANSIBLE_RETRY_FILES_ENABLED": "False",
            "ANSIBLE_UNSAFE_WRITES": "1",
            "ANSIBLE_SSH_CONTROL_PATH_DIR": str(self.folder / "cp"),
            "ANSIBLE_ROLES_PATH": str(self.folder / "requirements_roles"),
            "ANSIBLE_COLLECTIONS_PATH": f"{CHECKOUT / '.ansible' / 'collections'}",
            "PROJECT_REVISION": "0" * 40,
            "JOB_ID": "1",
            "INVENTORY_ID": "1",
            "AWX_HOST": "https://awx.example.org",
            **template.credential,
        }
        told = {"job_id": 1, "job_launch_type": "scheduled", "job_template_name": template.name, "user_name": "admin"}
        meta = {f"{product}_{name}": value for product in ("awx", "tower") for name, value in told.items()}
        # beside Ansible's own YAML, so that texts are texts; and nothing in a survey's answer is a template
        answers = "".join(f"{name}: {_unsafe(value)}\n" for name, value in template.variables.items())
        return {
            "project/ansible.cfg": CONFIG,
            "project/play.yml": f"- import_playbook: rosops.fleet.{template.playbook}\n",
            "inventory/hosts": SCRIPT.format(python=sys.executable, inventory=shuffled(template.inventory)),
            "env/envvars": json.dumps(environment),
            "env/extravars": yaml.safe_dump({**meta, **template.own}) + answers,
            "env/credential": "---\n{}\n",
            "env/settings": json.dumps({"idle_timeout": IDLE, "pexpect_timeout": 1}),
        }

    def _command_line(self) -> str:
        template = self.template
        # `--become` is the template's privilege escalation: for each task, those on localhost, too
        words = ["-u robot", "--become", "--become-method sudo", f"-e @{self.folder / 'env' / 'credential'}"]
        words += [f"--limit {template.limit}"] if template.limit else []
        words += [f"-t {template.tags}"] if template.tags else []
        words += [f"-{'v' * template.verbosity}"] if template.verbosity else []
        return " ".join(words)

    def _environment(self) -> dict[str, str]:
        """A container has the image's alone."""
        path = os.pathsep.join([str(Path(sys.executable).parent), "/usr/local/bin", "/usr/bin", "/bin", "/sbin"])
        return {"PATH": path, "HOME": str(self.folder / "home"), "LC_ALL": "C.UTF-8", "PYTHONDONTWRITEBYTECODE": "1"}

    @property
    def output(self) -> str:
        found = self.folder / "artifacts" / "job" / "stdout"
        return COLOUR.sub("", found.read_text(errors="replace")) if found.exists() else ""

    @property
    def running(self) -> bool:
        return self._process.poll() is None

    def wait_for(self, pattern: str, seconds: float = 600) -> None:
        """Until its output has the pattern."""
        searched, deadline = re.compile(pattern, re.MULTILINE), time.monotonic() + seconds
        while not searched.search(self.output):
            assert self.running, f"ended without {pattern!r}:\n{self.output[-3000:]}"
            assert time.monotonic() < deadline, f"{pattern!r} not seen within {seconds:g} s:\n{self.output[-3000:]}"
            time.sleep(0.02)

    def cancel(self) -> Ended:
        """As somebody who clicks on it: nothing of it gets a word to end by itself."""
        kill(self._processes)
        self._process.wait(timeout=30)
        return self._ended("canceled")

    def finish(self, seconds: float = 900) -> Ended:
        """Wait for its end. Where runner ends it, the container's other processes end with it, as podman does that."""
        try:
            self._process.wait(timeout=seconds)
        except subprocess.TimeoutExpired:
            self.cancel()
            raise AssertionError(f"the job ran for more than {seconds:g} s:\n{self.output[-3000:]}") from None
        kill(self._processes)
        return self._ended((self.folder / "artifacts" / "job" / "status").read_text())

    def _ended(self, status: str) -> Ended:
        place = self.folder / "artifacts" / "job"
        code = (place / "rc").read_text() if (place / "rc").exists() else "-1"
        events = []
        whole = [path for path in (place / "job_events").glob("*.json") if not path.stem.endswith("-partial")]
        for path in sorted(whole, key=lambda path: int(path.name.partition("-")[0])):
            with contextlib.suppress(ValueError):  # it was killed while it wrote
                events.append({**json.loads(path.read_text()), "at": path.stat().st_mtime})
        artifacts: dict[str, Any] = next(
            (one["event_data"]["artifact_data"] for one in reversed(events) if one["event"] == "playbook_on_stats"), {}
        )
        self.ended = Ended(status, int(code), self.output, artifacts, events)
        shutil.rmtree(self.folder)
        return self.ended

    def _processes(self) -> dict[int, str]:
        """Everything that was started by it. Ansible's workers are sessions of their own."""
        return marked(MARK, self.mark)


def shuffled(inventory: Mapping[str, Any]) -> dict[str, Any]:
    """The same hosts in another order, never in that of their names: AWX reads them out of its database without one."""
    lots = random.Random(time.time_ns())  # noqa: S311 - no secret
    found = json.loads(json.dumps(inventory))
    for hosts in [group["hosts"] for group in found.values() if "hosts" in group]:
        lots.shuffle(hosts)
        if hosts == sorted(hosts):
            hosts.reverse()
    return dict(found)


def _unsafe(value: object) -> str:
    """An answer as AWX writes it: no text is a template. A survey here has neither lists nor mappings."""
    return f"!unsafe {json.dumps(value)}" if isinstance(value, str) else json.dumps(value)
