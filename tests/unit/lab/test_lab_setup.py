# SPDX-License-Identifier: GPL-3.0-or-later
"""Which packages a machine is made to have: Debian's of a lab, Ubuntu's of GitHub's runners."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from lablib import setup
from lablib.artifacts import Cache

DEBIAN, UBUNTU = 'PRETTY_NAME="Debian"\nID=debian\n', 'NAME="Ubuntu"\nID=ubuntu\nID_LIKE=debian\n'


@pytest.fixture
def installs(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Any:
    """What apt-get is told to install on a machine with these packages and commands."""

    def install(system: str, there: set[str], commands: set[str], tests: bool = True) -> list[str]:
        asked: list[str] = []

        def run(words: list[str], check: bool) -> SimpleNamespace:
            assert (words[0], check) == ("dpkg-query", False)
            return SimpleNamespace(stdout="".join(f"{name} installed\n" for name in words[3:] if name in there))

        def build(job: Any) -> None:
            if "install" in job.command:
                asked.extend(job.command[job.command.index("--no-install-recommends") + 1 :])

        monkeypatch.setattr(setup, "run", run)
        monkeypatch.setattr(setup, "build", build)
        monkeypatch.setattr(setup, "LOGS", tmp_path)
        monkeypatch.setattr(setup.os, "geteuid", lambda: 0)
        monkeypatch.setattr(setup.shutil, "which", lambda name: name if name in {"dpkg-query", *commands} else None)
        setup._packages(Cache(tmp_path), setup.packages(tests, system))
        return asked

    return install


def test_what_a_bare_debian_lacks_is_installed(installs: Any) -> None:
    everything = sorted(setup.PACKAGES | setup.TEST_PACKAGES)
    assert installs(DEBIAN, set(), set()) == everything
    assert installs(DEBIAN, {"netavark", "runc"}, set()) == [n for n in everything if n not in ("netavark", "runc")]
    assert installs(DEBIAN, set(everything), set()) == []
    assert "chromium" not in installs(DEBIAN, set(), set(), tests=False)


def test_a_command_that_is_there_is_nobodys_to_replace(installs: Any) -> None:
    """Debian's runc takes Docker's containerd.io away, which brings its own."""
    asked = installs(DEBIAN, set(), {"runc", "google-chrome"})
    assert "podman" in asked
    assert {"runc", "chromium"}.isdisjoint(asked)


def test_ubuntu_has_no_package_chromium(installs: Any) -> None:
    assert "chromium" not in installs(UBUNTU, set(), set())
    assert "chromium" in installs(DEBIAN, set(), set())
