# SPDX-License-Identifier: GPL-3.0-or-later
"""On what the code that runs in pods is tried."""

from __future__ import annotations

import shutil
import subprocess
import sys


def pythons() -> list[str]:
    """The oldest Python that is meant, where it is here, and the one of this run."""
    oldest = shutil.which("python3.8")  # which may be a version manager's shim without that version
    script = "import sys; print(sys.executable)"
    real = subprocess.run([oldest, "-c", script], capture_output=True, text=True, check=False).stdout if oldest else ""  # noqa: S603
    return [sys.executable, *real.split()]
