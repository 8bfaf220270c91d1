# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Rigelfiles imported and deployed on a lab's hosts, and what their apps wrote collected.

`make test-rigel` makes the lab and takes it away; ROSOPS_LAB names one that stays. What the playbooks printed is kept
in reports/rigel.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(CHECKOUT / "tests" / name) for name in ("update", "apps", "tools")]

from cluster import Hosts  # noqa: E402 - found through the line above


@pytest.fixture(scope="session")
def lab() -> str:
    os.environ.setdefault("ROSOPS_LAB", "rigel")
    return os.environ["ROSOPS_LAB"]


@pytest.fixture(scope="session")
def hosts(lab: str) -> Hosts:
    return Hosts(lab)
