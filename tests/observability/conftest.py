# SPDX-License-Identifier: GPL-3.0-or-later
"""What watches a fleet: the real programs on loopback (test_configs), and a lab's fleet that they watch.

`molecule test --scenario-name observability` makes the lab and runs them. By hand, once it has converged:
`pytest tests/observability [-k NAME]` (ROSOPS_LAB names another lab). The cases are run in the order of their files:
first what only looks, then what disturbs. What the playbooks printed is kept in reports/observability.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent
CHECKOUT = HERE.parents[1]
sys.path[:0] = [
    str(HERE),
    *(str(CHECKOUT / "tests" / name) for name in ("update", "apps", "tools")),
    str(CHECKOUT / "tools"),
    str(CHECKOUT / ".ansible" / "collections"),
]

from watched import Watched  # noqa: E402 - found through the lines above

INVENTORY = CHECKOUT / "molecule" / "observability" / "inventory"
pytest_plugins = ["lab_cases"]


@pytest.fixture(scope="session")
def standing_fleet(figures: list[str]) -> Iterator[Watched]:
    """The lab's fleet, as converge or the test before left it."""
    made = Watched(os.environ.get("ROSOPS_LAB", "mol-obs"), INVENTORY, CHECKOUT / "reports" / "observability")
    made.figures = figures
    yield made


@pytest.fixture
def fleet(standing_fleet: Watched, request: pytest.FixtureRequest) -> Watched:
    """The same; figures stand under the case's name."""
    standing_fleet.say(f"{request.node.name}:")
    return standing_fleet


@pytest.fixture
def stack() -> Iterator[ExitStack]:
    """Programs on loopback, which end with the test."""
    with ExitStack() as programs:
        yield programs
