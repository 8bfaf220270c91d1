# SPDX-License-Identifier: GPL-3.0-or-later
"""Let plain pytest import the collection by its full name, from any checkout path, and our own tools."""

from __future__ import annotations

import sys
from pathlib import Path

CHECKOUT = Path(__file__).resolve().parents[2]
TREE = CHECKOUT / ".ansible" / "collections"

# Under `ansible-test units` the checkout already stands in a collections tree that ansible-test puts on the path.
if (TREE / "ansible_collections" / "rosops" / "fleet").exists():
    sys.path.insert(0, str(TREE))
    # What is compiled is kept for the next run, and not beside the sources. Processes that tests start keep nothing.
    sys.pycache_prefix, sys.dont_write_bytecode = str(CHECKOUT / ".cache" / "pycache"), False
OURS = ("tests/tools", "tools", "tests/lab", "tests/apps", "benchmarks")  # of no namespace
sys.path[:0] = [str(CHECKOUT / name) for name in OURS]
