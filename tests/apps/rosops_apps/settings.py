# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings from the environment, as a container gets them."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Mapping, Optional

Environ = Optional[Mapping[str, str]]  # None: that of the process
SENSOR_RATE = 500.0  # samples a second


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


def not_negative(name: str, default: float, environ: Environ = None) -> float:
    """A number, 0 or above."""
    return 0.0 if _get(name, environ) in {"0", "0.0"} else positive(name, default, environ)


def whole(name: str, default: int, environ: Environ = None) -> int:
    """A whole number above 0."""
    number = positive(name, default, environ)
    if number != int(number):
        raise SettingError(f"{name} must be a whole number, not {number:g}")
    return int(number)


def flag(name: str, environ: Environ = None) -> bool:
    """true or false, as YAML writes them; Ansible's templates write them with a capital."""
    text = _get(name, environ).lower() or "false"
    if text not in {"true", "false"}:
        raise SettingError(f"{name} must be true or false, not {text!r}")
    return text == "true"


def queue_size(environ: Environ = None) -> int:
    """How many messages wait on a topic before the oldest is dropped."""
    return whole("QUEUE_SIZE", 1000, environ)


def rates(environ: Environ = None) -> tuple[float, int]:
    """Readings a second (RATE_HZ), and of how many samples of the sensor one is published.

    A reading's number is that of the sample: a version that publishes at half the rate leaves out every other number,
    it does not count differently.
    """
    rate = positive("RATE_HZ", SENSOR_RATE, environ)
    stride = round(SENSOR_RATE / rate)
    if stride < 1 or abs(rate * stride - SENSOR_RATE) > 1e-6 * SENSOR_RATE:
        raise SettingError(f"RATE_HZ {rate:g} must be {SENSOR_RATE:g}, the sensor's, divided by a whole number")
    return rate, stride


def faults(environ: Environ = None) -> tuple[float, bool]:
    """How a bad version behaves: CRASH_AFTER so many seconds, 0 for never, and whether it is to NEVER_CONNECT."""
    return positive("CRASH_AFTER", 0.0, environ), flag("NEVER_CONNECT", environ)


def choice(name: str, allowed: tuple[str, ...], environ: Environ = None) -> str:
    """One of the allowed words; the first is the default."""
    text = _get(name, environ) or allowed[0]
    if text not in allowed:
        raise SettingError(f"{name} must be one of {', '.join(allowed)}, not {text!r}")
    return text


def metrics_port(environ: Environ = None) -> int:
    """The port of the metrics; 0 without METRICS_PORT: there are none."""
    port = whole("METRICS_PORT", 0, environ)
    if port > 65535:
        raise SettingError(f"METRICS_PORT must be a port, 1 to 65535, not {port}")
    return port


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


def version(environ: Environ = None) -> str:
    """The version of the applications: the environment's, else the one they were built as."""
    text = _get("ROSOPS_APPS_VERSION", environ)
    if text:
        return text
    try:
        return (Path(__file__).resolve().parents[2] / "VERSION").read_text(encoding="utf-8").strip()
    except FileNotFoundError:
        return "unversioned"
