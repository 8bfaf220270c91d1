# SPDX-License-Identifier: GPL-3.0-or-later
"""Python environments: `.venv`, and one of its own for what cannot live there, as another ansible-core."""

from __future__ import annotations

import hashlib
import sys
import time
from dataclasses import dataclass
from pathlib import Path

from .artifacts import Cache
from .errors import LabError
from .names import checkout_id
from .paths import CHECKOUT, LOGS
from .run import Job, build, say

FILES = CHECKOUT / "tests" / "environments"


@dataclass(frozen=True)
class Environment:
    """What `requirements` pins, for the Python that runs this, in `directory`."""

    directory: Path
    requirements: Path

    @property
    def python(self) -> Path:
        return self.directory / "bin" / "python"

    def ensure(self) -> None:
        """Make it, unless it is there and made of the same; a half-made one has no stamp and is made again."""
        wanted = fingerprint(contents(self.requirements), sys.executable, sys.version)
        stamp = self.directory / ".requirements"
        if stamp.exists() and stamp.read_text() == wanted and self.python.exists():
            return
        name = self.directory.name.lstrip(".")
        log = LOGS / ("pip.log" if name == "venv" else f"pip-{name}.log")
        log.unlink(missing_ok=True)
        started = time.monotonic()
        say(f"making {self.directory} from {self.requirements.name} (log {log})")
        stamp.unlink(missing_ok=True)
        build(Job([sys.executable, "-m", "venv", "--clear", str(self.directory)], str(self.directory), log))
        pip = [str(self.python), "-m", "pip", "--disable-pip-version-check", "--no-input"]
        install = [*pip, "install", "--retries", "5", "--requirement", str(self.requirements)]
        build(Job(install, f"Python packages of {self.directory}", log))
        stamp.write_text(wanted)
        say(f"made {self.directory} in {time.monotonic() - started:.0f} s")


def tools_environment() -> Environment:
    return Environment(CHECKOUT / ".venv", CHECKOUT / "requirements.txt")


def environment(cache: Cache, name: str) -> Environment:
    """The one that tests/environments/<name>.txt describes, ready to use."""
    known = sorted(path.stem for path in FILES.glob("*.txt"))
    if name not in known:
        raise LabError(f"there is no environment {name}", where=str(FILES), todo=f"take one of {', '.join(known)}")
    LOGS.mkdir(exist_ok=True)
    made = Environment(LOGS / "environments" / name, FILES / f"{name}.txt")
    with cache.lock(f"{name}-{checkout_id(str(CHECKOUT))}", f"the making of environment {name}"):
        made.ensure()
    return made


def contents(requirements: Path) -> bytes:
    """Of the file, and of those that it takes in by -r and -c."""
    text = requirements.read_bytes()
    others = [line.split(maxsplit=1)[1] for line in text.decode().splitlines() if line.startswith(("-r ", "-c "))]
    return b"\0".join([text, *(contents(requirements.parent / other.strip()) for other in others)])


def fingerprint(requirements: bytes, python: str, version: str) -> str:
    """What the environment was made of; it stands in the stamp that is written last."""
    return hashlib.sha256(requirements + f"\0{python}\0{version}".encode()).hexdigest()
