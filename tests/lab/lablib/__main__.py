# SPDX-License-Identifier: GPL-3.0-or-later
"""Entry point of `tests/lab/lab`: the package is started by its path, so its parent directory has to be made known."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path[0] = str(Path(__file__).resolve().parent.parent)

from lablib.cli import main  # noqa: E402 - only importable once the path above is set

if __name__ == "__main__":
    sys.exit(main())
