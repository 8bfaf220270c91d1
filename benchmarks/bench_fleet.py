# SPDX-License-Identifier: GPL-3.0-or-later
"""What the engine costs the control node per robot: fleets of simulated robots with 12 apps each, all of them changed.

Of a hundred robots ten are busy, five off, and three get a version that is refused. It fails where an outcome is not
what it has to be, or where a robot of the largest fleet costs more than twice what one of the smallest does.
"""

from __future__ import annotations

import argparse
import os
import platform
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

CHECKOUT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(CHECKOUT / ".ansible" / "collections")]

from ansible_collections.rosops.fleet.plugins.plugin_utils._model.context import Robot  # noqa: E402
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.hands import Settings  # noqa: E402
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.ledger import Ledger  # noqa: E402
from ansible_collections.rosops.fleet.tests.unit.robots import robot  # noqa: E402
from ansible_collections.rosops.fleet.tests.unit.simulated.objects import app  # noqa: E402
from ansible_collections.rosops.fleet.tests.unit.simulated.robot import FOREVER, OFFERS, Offer, image  # noqa: E402
from ansible_collections.rosops.fleet.tests.unit.simulated.world import Simulation  # noqa: E402
from published import HELP, Table, publish  # noqa: E402 - all of these are found through the line above

SIZES = (10, 30, 100)
APPS = ("sensor", "stats", "driver", "planner", *(f"app{number}" for number in range(8)))
OFFERS.update({name: Offer({f"{name}_out": 10.0}) for name in APPS if name not in OFFERS})
SHARES = {"deferred-busy": 0.1, "deferred-offline": 0.05, "rolled-back": 0.03}
SETTINGS = Settings(ready_timeout=30.0, busy_timeout=60.0)


def wanted(name: str, version: str, number: int) -> Robot:
    """The planner first: a busy robot waits before anything of it was changed."""
    images = {"sensor": image(version, number)}
    apps = sorted(APPS, key=lambda one: one != "planner")
    return robot(
        *(app(one, images.get(one, image("good", number)), pattern="action" if one == "planner" else "pubsub")
          for one in apps),
        name=name,
    )  # fmt: skip


def fates(size: int) -> list[str]:
    """What becomes of every robot; the first ones are those with whom something is."""
    found = [word for word, share in SHARES.items() for _robot in range(round(size * share))]
    return [*found, *["updated"] * (size - len(found))]


def fleet(size: int, folder: Path) -> tuple[float, float, str]:
    """Seconds and processor seconds per robot, and what became of them."""
    expected, seen = fates(size), Counter[str]()
    seconds = processor = 0.0
    for number, fate in enumerate(expected):
        name, sim = f"robot{number}", Simulation()
        sim.install(wanted(name, "good", 0))
        if fate == "deferred-busy":
            sim.goal("/plan", 9999.0)
        sim.advance(1.0)
        if fate == "deferred-offline":
            sim.robot_until = FOREVER
        began, used = time.perf_counter(), time.process_time()
        ledger = Ledger(folder, str(number * 4 // size))
        refusal = ledger.refusal("10%", size)
        outcome = sim.run(wanted(name, "half-the-rate" if fate == "rolled-back" else "good", 1), SETTINGS)
        assert outcome is not None
        ledger.note(name, outcome.outcome)
        seconds, processor = seconds + time.perf_counter() - began, processor + time.process_time() - used
        assert (outcome.outcome, refusal) == (fate, ""), (name, outcome, refusal)
        seen[outcome.outcome] += 1
    told = ", ".join(f"{count} {word}" for word, count in sorted(seen.items()))
    each = f"{1000 * seconds / size:6.0f} ms and {1000 * processor / size:6.0f} ms of a core per robot"
    print(f"{size:4d} robots: {each}; {told}")
    return seconds / size, processor / size, told


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--publish", action="store_true", help=HELP)
    options = parser.parse_args()
    found = []
    for size in SIZES:
        with tempfile.TemporaryDirectory() as folder:
            found.append(fleet(size, Path(folder)))
    linear = found[-1][1] <= 2 * found[0][1]
    said = "linear" if linear else "a robot of the largest fleet costs more than twice what one of the smallest does"
    print(said)
    if options.publish:
        rows = [
            [str(size), f"{1000 * seconds:.0f}", f"{1000 * processor:.0f}", told]
            for size, (seconds, processor, told) in zip(SIZES, found, strict=True)
        ]
        about = (
            f"The update engine with simulated robots of {len(APPS)} apps, a new version of each for every robot, in "
            f"one process; per robot, on {os.cpu_count()} cores, {platform.machine()}: {said}."
        )
        heads = ["robots", "wall ms per robot", "processor ms per robot", "outcomes"]
        publish("engine", Table("The engine with many robots", about, heads, rows))
    return 0 if linear else 1


if __name__ == "__main__":
    sys.exit(main())
