# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs make targets one after the other and says at the end which passed.

A failed stage does not stop the later ones: one run shows all that is broken. Only the first stages, which prepare what
the others need, do.
"""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

PREPARING = ("setup-tests", "artifacts")
CHECKOUT = Path(__file__).resolve().parent.parent


def run_stage(name: str) -> bool:
    print(f"=== {name}", flush=True)
    done = subprocess.run(["make", name], cwd=CHECKOUT, check=False)  # noqa: S603, S607 - make itself started this
    return done.returncode == 0


def main(names: list[str]) -> int:
    results: list[tuple[str, str, float]] = []
    stopped = False
    for name in names:
        if stopped:
            results.append((name, "not run", 0.0))
            continue
        started = time.monotonic()
        passed = run_stage(name)
        results.append((name, "passed" if passed else "FAILED", time.monotonic() - started))
        stopped = not passed and name in PREPARING
    passed_count = sum(verdict == "passed" for _name, verdict, _seconds in results)
    print("=== stages")
    for name, verdict, seconds in results:
        print(f"{name:<18} {verdict:<8} {seconds:7.1f} s")
    failed_count = len(results) - passed_count
    print(f"stages took {sum(seconds for *_rest, seconds in results):.0f} s")
    print(f"{passed_count} passed, {failed_count} failed", flush=True)
    return 0 if failed_count == 0 else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
