# SPDX-License-Identifier: GPL-3.0-or-later
"""The experiment: every update, by plain Kubernetes and by update.yml, on one cluster, in turn.

    make bench

It brings up a lab of its own, runs the rounds, and removes the lab. A round is one arm with all its applications: a
quiet beginning, every update one after the other, then what the applications' own logs say. A round that is over is a
line in benchmarks/update/results/trials.jsonl and not run again: a run goes on where the last one was cut off. Its
own logs and reports are written to benchmarks/results/. A bar that is missed is a result, and the exit status is 0; a
measurement that failed is not (1: some of them failed, 2: there is no result).
"""

from __future__ import annotations

import sys

from update.cli import main

if __name__ == "__main__":
    sys.exit(main())
