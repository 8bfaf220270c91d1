# SPDX-License-Identifier: GPL-3.0-or-later
"""Where things are: the checkout, its lab state, the user's cache, and the pins.

Installed with pip, the lab belongs to the directory that it is called in, or to ROSOPS_LAB_HOME: state is kept and labs
are named by that, as by a checkout.
"""

from __future__ import annotations

import os
import tomllib
from functools import cache
from pathlib import Path
from typing import Any

LAB = Path(__file__).resolve().parent.parent
INSTALLED = not (LAB / "pyproject.toml").is_file()
CHECKOUT = Path(os.environ.get("ROSOPS_LAB_HOME") or Path.cwd()).resolve() if INSTALLED else LAB.parent.parent
COMMAND = "rosops-lab" if INSTALLED else "tests/lab/lab"
STATE = CHECKOUT / ".lab"
LOGS = CHECKOUT / ".cache"
IMAGES = LAB / "images"
LABK3S = LAB / "labk3s"
OBSERVABILITY = LAB / "observability"
APPS = LAB / "apps" if INSTALLED else CHECKOUT / "tests" / "apps"


def cache_dir() -> Path:
    base = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    return Path(base) / "rosops-fleet"


def state_dir(lab: str) -> Path:
    return STATE / lab


@cache
def pins() -> dict[str, Any]:
    with (LAB / "pins.toml").open("rb") as handle:
        return tomllib.load(handle)
