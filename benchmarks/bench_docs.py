# SPDX-License-Identifier: GPL-3.0-or-later
"""Write docs/benchmarks.md and its pictures anew, out of benchmarks/update/results/trials.jsonl: make bench-docs"""

from __future__ import annotations

import sys

from update.page import main

if __name__ == "__main__":
    sys.exit(main())
