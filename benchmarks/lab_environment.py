# SPDX-License-Identifier: GPL-3.0-or-later
"""What every benchmark on a lab gives the commands that it starts."""

from __future__ import annotations

import os
from pathlib import Path

CHECKOUT = Path(__file__).resolve().parents[1]


def environment(lab: str, checkout: Path = CHECKOUT) -> dict[str, str]:
    """A checkout's tools and settings, also without make; the lab's inventory."""
    return {
        **os.environ,
        "PATH": f"{checkout / '.venv' / 'bin'}{os.pathsep}{os.environ['PATH']}",
        "ANSIBLE_CONFIG": str(checkout / "ansible.cfg"),
        "ANSIBLE_HOME": str(checkout / ".ansible"),
        "ANSIBLE_COLLECTIONS_PATH": str(checkout / ".ansible" / "collections"),
        "ANSIBLE_NOCOLOR": "1",
        "LC_ALL": "C.UTF-8",
        "ROSOPS_LAB": lab,
    }
