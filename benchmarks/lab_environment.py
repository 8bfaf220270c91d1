# SPDX-License-Identifier: GPL-3.0-or-later
"""What every benchmark on a lab gives the commands that it starts."""

from __future__ import annotations

import os
from pathlib import Path

CHECKOUT = Path(__file__).resolve().parents[1]
LAB = CHECKOUT / "tests" / "lab" / "lab"


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


def inventory(lab: str, checkout: Path, made: Path) -> Path:
    """The lab's. For another checkout one is made there: that one's variables, and this one's lab."""
    if checkout == CHECKOUT:
        return CHECKOUT / "inventories" / "lab"
    made.mkdir(parents=True, exist_ok=True)
    script = made / "hosts.sh"
    script.write_text(f'#!/bin/sh\nexec "{LAB}" inventory --lab "{lab}" "$@"\n', encoding="utf-8")
    script.chmod(0o755)
    link = made / "group_vars"
    link.unlink(missing_ok=True)
    link.symlink_to(checkout / "inventories" / "lab" / "group_vars")
    return made
