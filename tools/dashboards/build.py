# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes the role's Grafana dashboards (roles/observability/files/dashboards): a query or a unit stands in one place.

make dashboards                             # write them
PYTHONPATH=tools python -m dashboards --check    # fail if a file is not what would be written
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from .application import application
from .fleet import fleet, robot
from .hosts import hosts
from .page import PREFIX
from .panels import Json
from .ros import ros_graph, topics
from .telemetry import log_pages, telemetry
from .updates import updates

CHECKOUT = Path(__file__).resolve().parents[2]
FOLDER = CHECKOUT / "roles" / "observability" / "files" / "dashboards"


def dashboards() -> dict[str, Json]:
    """Every dashboard by its name, the way they stand in Grafana's list."""
    made = [fleet(), robot(), application(), ros_graph(), topics(), updates(), hosts(), log_pages(), telemetry()]
    return {str(page["uid"]).removeprefix(PREFIX): page for page in made}


def written() -> dict[str, str]:
    """File name to what has to be in it."""
    return {f"{name}.json": json.dumps(page, indent=2) + "\n" for name, page in dashboards().items()}


def stale(folder: Path) -> list[str]:
    """Files that are missing, differ, or that nothing makes."""
    there = {path.name: path.read_text("utf-8") for path in folder.glob("*.json")}
    wanted = written()
    return sorted(name for name in there.keys() | wanted.keys() if there.get(name) != wanted.get(name))


def main() -> int:
    """Write or check."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--check", action="store_true", help="write nothing, fail if something would be")
    wrong = stale(FOLDER)
    if parser.parse_args().check:
        if wrong:
            print(f"not what `make dashboards` writes: {', '.join(wrong)}", file=sys.stderr)
        return 1 if wrong else 0
    FOLDER.mkdir(parents=True, exist_ok=True)
    for name in wrong:
        text = written().get(name)
        if text is None:
            (FOLDER / name).unlink()
        else:
            (FOLDER / name).write_text(text, "utf-8")
    return 0
