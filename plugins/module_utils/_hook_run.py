# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The entry of what runs in pods, there as `run.py`: `python3 run.py exec|started|ready|stop|keeper`.

Nothing more than the way to the command's own module, because a script, unlike a module, is compiled at every start.
"""

# importing pathlib would cost as much as all the rest of a call:
# ruff: noqa: PTH100, PTH120, PTH119
from __future__ import annotations

import importlib
import os
import sys

COMMANDS = {
    "exec": "_hook_exec",
    "started": "_hook_started",
    "ready": "_hook_ready",
    "stop": "_hook_stop",
    "keeper": "_keeper_run",
}


def main(words: list[str]) -> int:
    """Import the command's module out of the directory that this file appears in, and run it."""
    if len(words) < 2 or words[1] not in COMMANDS:
        sys.stdout.write(f"usage: run.py {'|'.join(COMMANDS)}\n")
        return 2
    # not the real path: a ConfigMap's files are links, and the package is where they appear
    package = os.path.dirname(os.path.abspath(words[0]))
    # The mount is read-only, so compiled modules go where the pod may write; a directory per user, as nobody else's is
    # to be trusted.
    sys.pycache_prefix = f"/tmp/rosops-fleet-{os.getuid()}/pycache"  # noqa: S108
    sys.path.insert(0, os.path.dirname(package))
    module = importlib.import_module(f"{os.path.basename(package)}.{COMMANDS[words[1]]}")
    result: int = module.main(words[2:])
    return result


if __name__ == "__main__":
    raise SystemExit(main(sys.argv))
