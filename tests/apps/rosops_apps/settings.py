# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings from the environment, as a container gets them."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Mapping, Optional

Environ = Optional[Mapping[str, str]]  # None: that of the process


class SettingError(Exception):
    """An environment variable holds what it must not."""


def _get(name: str, environ: Environ) -> str:
    return (os.environ if environ is None else environ).get(name, "")


def positive(name: str, default: float, environ: Environ = None) -> float:
    """A number above 0."""
    text = _get(name, environ)
    if not text:
        return default
    try:
        number = float(text)
    except ValueError:
        number = 0.0
    if not 0 < number < float("inf"):
        raise SettingError(f"{name} must be a number above 0, not {text!r}")
    return number


def choice(name: str, allowed: tuple[str, ...], environ: Environ = None) -> str:
    """One of the allowed words; the first is the default."""
    text = _get(name, environ) or allowed[0]
    if text not in allowed:
        raise SettingError(f"{name} must be one of {', '.join(allowed)}, not {text!r}")
    return text


def log_dir(environ: Environ = None) -> Path | None:
    """Where the log goes, if there is to be one."""
    text = _get("LOG_DIR", environ)
    return Path(text) if text else None


def required_log_dir(environ: Environ = None) -> Path:
    """Where the log goes, for an application whose log is the point."""
    directory = log_dir(environ)
    if directory is None:
        raise SettingError("LOG_DIR must name the directory of the log")
    return directory


def ready_file(environ: Environ = None) -> Path:
    """The file whose existence says that the application is ready."""
    return Path(_get("READY_FILE", environ) or "/tmp/ready")  # noqa: S108 - a container's own /tmp


def version(environ: Environ = None) -> str:
    """The version of the applications: the environment's, else the one they were built as."""
    text = _get("ROSOPS_APPS_VERSION", environ)
    if text:
        return text
    try:
        return (Path(__file__).resolve().parents[2] / "VERSION").read_text(encoding="utf-8").strip()
    except FileNotFoundError:
        return "unversioned"
