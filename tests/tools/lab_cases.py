# SPDX-License-Identifier: GPL-3.0-or-later
"""What every suite on a lab's fleet has: which of its cases are run, and a list of what was measured.

`--cases promises` takes one case for each promise, by the mark that names it, but for those that are marked as long,
and the cases that need no fleet; `all` leaves out only what is marked as a fault that takes hours; `faults` is all.

A plugin of pytest, named by the suites' conftest files.
"""

from __future__ import annotations

from typing import Any

import pytest

FIGURES = pytest.StashKey[list[str]]()


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--cases", choices=["promises", "all", "faults"], default="all", help="which cases (default: all)")


def pytest_configure(config: pytest.Config) -> None:
    config.stash[FIGURES] = []
    config.addinivalue_line(
        "markers", "promise(what): the one case that proves it on real hosts whenever tests are run"
    )
    config.addinivalue_line(
        "markers", "long: a promise whose decisions are proven without hosts, too; not for `promises`"
    )
    config.addinivalue_line("markers", "faults: a case that takes hours; only with --cases faults")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    wanted = config.getoption("--cases")
    left = [item for item in items if not wants(wanted, item)]
    config.hook.pytest_deselected(items=left)
    items[:] = [item for item in items if item not in left]


def wants(wanted: str, item: pytest.Item) -> bool:
    """Whether a case is among those."""
    if item.get_closest_marker("faults"):
        return wanted == "faults"
    on_hosts = "standing_fleet" in getattr(item, "fixturenames", ())
    promised = item.get_closest_marker("promise") is not None and item.get_closest_marker("long") is None
    return wanted != "promises" or not on_hosts or promised


@pytest.fixture(scope="session")
def figures(pytestconfig: pytest.Config) -> list[str]:
    """Lines of the summary; one that ends in a colon is a case's name, those after it are what it measured."""
    return pytestconfig.stash[FIGURES]


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:
    terminalreporter.section("what was measured")
    for line in config.stash[FIGURES]:
        terminalreporter.write_line(line if line.endswith(":") else f"    {line}")
