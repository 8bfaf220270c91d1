# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings from the environment, as a container gets them."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Mapping


class SettingError(Exception):
    """An environment variable holds what it must not."""


def positive(name: str, default: float, environ: Mapping[str, str] = os.environ) -> float:
    """A number above 0."""
    text = environ.get(name, "")
    if not text:
        return default
    try:
        number = float(text)
    except ValueError:
        number = 0.0
    if not 0 < number < float("inf"):
        raise SettingError(f"{name} must be a number above 0, not {text!r}")
    return number


def choice(name: str, allowed: tuple[str, ...], environ: Mapping[str, str] = os.environ) -> str:
    """One of the allowed words; the first is the default."""
    text = environ.get(name, "") or allowed[0]
    if text not in allowed:
        raise SettingError(f"{name} must be one of {', '.join(allowed)}, not {text!r}")
    return text


def log_dir(environ: Mapping[str, str] = os.environ) -> Path | None:
    """Where the log goes, if there is to be one."""
    text = environ.get("LOG_DIR", "")
    return Path(text) if text else None


def required_log_dir(environ: Mapping[str, str] = os.environ) -> Path:
    """Where the log goes, for an application whose log is the point."""
    directory = log_dir(environ)
    if directory is None:
        raise SettingError("LOG_DIR must name the directory of the log")
    return directory


def ready_file(environ: Mapping[str, str] = os.environ) -> Path:
    """The file whose existence says that the application is ready."""
    return Path(environ.get("READY_FILE", "") or "/tmp/ready")  # noqa: S108 - a container's own /tmp


def version(environ: Mapping[str, str] = os.environ) -> str:
    """The version of the applications: the environment's, else the one they were built as."""
    text = environ.get("ROSOPS_APPS_VERSION", "")
    if text:
        return text
    try:
        return (Path(__file__).resolve().parents[2] / "VERSION").read_text(encoding="utf-8").strip()
    except FileNotFoundError:
        return "unversioned"
