# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Updates of a fleet in the lab, from the outside: playbooks in, the apps' own accounts out.

`molecule test --scenario-name update` makes the lab and runs them. By hand, once it has converged:
`pytest tests/update [-k NAME]` (ROSOPS_LAB names another lab). Each case starts from a fleet at rest and brings it
there itself if the one before failed. What the playbooks printed is kept in reports/update.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any, Iterator

import pytest

HERE = Path(__file__).resolve().parent
CHECKOUT = HERE.parents[1]
sys.path[:0] = [str(HERE), str(CHECKOUT / "tests" / "apps")]

from fleet import Fleet  # noqa: E402 - found through the lines above

INVENTORY = CHECKOUT / "molecule" / "update" / "inventory"
FIGURES = pytest.StashKey[list[str]]()


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--faults", action="store_true", help="also the cases that take long")


def pytest_configure(config: pytest.Config) -> None:
    config.stash[FIGURES] = []
    config.addinivalue_line("markers", "faults: a case that takes long; only with --faults")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if not config.getoption("--faults"):
        chosen = [item for item in items if not item.get_closest_marker("faults")]
        config.hook.pytest_deselected(items=[item for item in items if item not in chosen])
        items[:] = chosen


@pytest.fixture(scope="session")
def standing_fleet(pytestconfig: pytest.Config) -> Iterator[Fleet]:
    """The lab's fleet, as converge or the test before left it."""
    made = Fleet(os.environ.get("ROSOPS_LAB", "mol-update"), INVENTORY, CHECKOUT / "reports" / "update")
    made.figures = pytestconfig.stash[FIGURES]
    yield made


@pytest.fixture
def fleet(standing_fleet: Fleet, request: pytest.FixtureRequest) -> Fleet:
    """The fleet at rest: every app runs what its inventory says."""
    standing_fleet.settle()
    standing_fleet.figures.append(f"{request.node.name}:")
    return standing_fleet


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:
    """What every case counted."""
    terminalreporter.section("what the apps noticed")
    for line in config.stash[FIGURES]:
        terminalreporter.write_line(line if line.endswith(":") else f"    {line}")
