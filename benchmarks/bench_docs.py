# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Write docs/benchmarks.md and its pictures anew, out of benchmarks/update/results/trials.jsonl: make bench-docs"""

from __future__ import annotations

import sys

from update.page import main

if __name__ == "__main__":
    sys.exit(main())
