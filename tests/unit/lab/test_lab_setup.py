# SPDX-License-Identifier: GPL-3.0-or-later
"""Which packages a machine is made to have: Debian's of a lab, Ubuntu's of GitHub's runners."""

from __future__ import annotations

import shutil
import subprocess
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


@pytest.mark.skipif(not shutil.which("apt-get"), reason="needs apt-get")
def test_apt_takes_what_is_asked_of_a_runner(installs: Any, tmp_path: Path) -> None:
    """apt-get itself, with a list of packages as a runner's: no chromium, and Docker's containerd, which has a runc."""
    lists, archive = tmp_path / "apt", tmp_path / "archive"
    names = [name for name in setup.packages(True, UBUNTU) if name != "runc"]
    form = "Package: {}\nVersion: 1\nArchitecture: all\nFilename: {}.deb\nSize: 1\nMD5sum: {:032x}\n{}\n"
    docker = "Conflicts: runc\nProvides: runc\n"
    rows = [form.format(name, name, 1, "") for name in [*names, "runc"]]
    rows.append(form.format("containerd.io", "containerd.io", 1, docker))
    for place in ("lists/partial", "state", "cache/archives/partial", "etc/apt.conf.d", "etc/preferences.d"):
        (lists / place).mkdir(parents=True)
    archive.mkdir()
    (archive / "Packages").write_text("\n".join(rows))
    (lists / "etc/sources.list").write_text(f"deb [trusted=yes] file:{archive} ./\n")
    installed = form.replace("Filename: {}.deb\nSize: 1\nMD5sum: {:032x}\n", "Status: install ok installed\n")
    (lists / "state/status").write_text(installed.format("containerd.io", docker))
    options = [
        "-o", f"Dir::Etc={lists}/etc", "-o", f"Dir::State={lists}/state", "-o", f"Dir::State::lists={lists}/lists",
        "-o", f"Dir::State::status={lists}/state/status", "-o", f"Dir::Cache={lists}/cache",
        "-o", "APT::Sandbox::User=root",
    ]  # fmt: skip

    def apt(*words: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(["apt-get", "-q", *options, *words], capture_output=True, text=True, check=False)  # noqa: S603, S607

    assert apt("update").returncode == 0
    simulate = ("install", "--simulate", "--no-install-recommends")
    taken = apt(*simulate, *installs(UBUNTU, set(), {"runc", "google-chrome"}))
    assert taken.returncode == 0, taken
    assert "Inst podman" in taken.stdout
    assert "Remv" not in taken.stdout
    # what was asked before: the one fails all of it, the other takes Docker away
    assert "chromium" in apt(*simulate, "podman", "chromium").stderr
    assert "Remv containerd.io" in apt(*simulate, "runc").stdout
