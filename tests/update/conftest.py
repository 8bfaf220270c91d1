# SPDX-License-Identifier: GPL-3.0-or-later
"""Updates of a fleet in the lab, from the outside: playbooks in, the apps' own accounts out.

`molecule test --scenario-name update` makes the lab and runs them. By hand, once it has converged:
`pytest tests/update [-k NAME]` (ROSOPS_LAB names another lab). Each case starts from a fleet at rest and brings it
there itself if the one before failed. What the playbooks printed is kept in reports/update.
"""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent
CHECKOUT = HERE.parents[1]
sys.path[:0] = [str(HERE), *(str(CHECKOUT / "tests" / name) for name in ("apps", "tools"))]

from fleet import Fleet  # noqa: E402 - found through the lines above

INVENTORY = CHECKOUT / "molecule" / "update" / "inventory"
pytest_plugins = ["lab_cases"]


@pytest.fixture(scope="session")
def standing_fleet(figures: list[str]) -> Iterator[Fleet]:
    """The lab's fleet, as converge or the test before left it."""
    made = Fleet(os.environ.get("ROSOPS_LAB", "mol-update"), INVENTORY, CHECKOUT / "reports" / "update")
    made.figures = figures
    yield made


@pytest.fixture
def tmp_path() -> Iterator[Path]:
    """Shorter than pytest's: homes lie in it, and SSH's sockets in these, whose path has 107 characters at most."""
    with tempfile.TemporaryDirectory(prefix="", ignore_cleanup_errors=True) as made:
        yield Path(made)


@pytest.fixture
def fleet(standing_fleet: Fleet, request: pytest.FixtureRequest) -> Fleet:
    """The fleet at rest: every app runs what its inventory says."""
    standing_fleet.settle()
    standing_fleet.figures.append(f"{request.node.name}:")
    return standing_fleet
