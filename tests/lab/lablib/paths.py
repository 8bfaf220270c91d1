# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where things are: the checkout, its lab state, the user's cache, and the pins."""

from __future__ import annotations

import os
import tomllib
from functools import cache
from pathlib import Path
from typing import Any

LAB = Path(__file__).resolve().parent.parent
CHECKOUT = LAB.parent.parent
STATE = CHECKOUT / ".lab"
LOGS = CHECKOUT / ".cache"
IMAGES = LAB / "images"
LABK3S = LAB / "labk3s"
OBSERVABILITY = LAB / "observability"
APPS = CHECKOUT / "tests" / "apps"


def cache_dir() -> Path:
    base = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    return Path(base) / "rosops-fleet"


def state_dir(lab: str) -> Path:
    return STATE / lab


@cache
def pins() -> dict[str, Any]:
    with (LAB / "pins.toml").open("rb") as handle:
        return tomllib.load(handle)
