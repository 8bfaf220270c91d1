# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The entry of what runs in pods, there as `run.py`: `python3 run.py exec|started|stop|keeper|exporter`.

Nothing more than the way to the command's own module, because a script, unlike a module, is compiled at every start.
"""

# importing pathlib would cost as much as all the rest of a call:
# ruff: noqa: PTH100, PTH110, PTH120
from __future__ import annotations

import importlib
import os
import sys
from importlib.machinery import ModuleSpec, SourceFileLoader

COMMANDS = {
    "exec": "_pod.exec",
    "started": "_pod.started",
    "stop": "_pod.stop",
    "keeper": "_pod.keeper_main",
    "exporter": "_exporter.main",
}
LONG_LIVED = ("keeper", "exporter")
ROOT = "rosops_fleet"


class Flat:
    """Finds the module `_ros.gate` in the file `_ros.gate.py`: the keys of a ConfigMap know no directories."""

    def __init__(self, directory: str) -> None:
        self.directory = directory

    def find_spec(self, name: str, _path: object = None, _target: object = None) -> ModuleSpec | None:
        if name.partition(".")[0] != ROOT:
            return None
        file = f"{self.directory}/{name[len(ROOT) + 1 :]}.py"
        if not os.path.exists(file):
            return ModuleSpec(name, None, is_package=True)
        spec = ModuleSpec(name, SourceFileLoader(name, file), origin=file)
        spec.has_location = True
        return spec


def main(words: list[str]) -> int:
    """Import the command's module out of the directory that this file appears in, and run it."""
    if len(words) < 2 or words[1] not in COMMANDS:
        sys.stdout.write(f"usage: run.py {'|'.join(COMMANDS)}\n")
        return 2
    # not the real path: a ConfigMap's files are links, and the other files are where they appear
    directory = os.path.dirname(os.path.abspath(words[0]))
    # The mount is read-only, so compiled modules go where the pod may write; a directory per user, as nobody else's is
    # to be trusted.
    sys.pycache_prefix = f"/tmp/rosops-fleet-{os.getuid()}/pycache"  # noqa: S108
    sys.meta_path.append(Flat(directory))
    if words[1] == "exporter":
        # its container has no place to write to
        sys.dont_write_bytecode = True
    if words[1] in LONG_LIVED:
        # ROS 1 knows no TLS. Without this, http.client would load OpenSSL, 4 MB, whether somebody uses it or not.
        modules: dict[str, object] = sys.modules  # type: ignore[assignment]
        modules["ssl"] = None
    module = importlib.import_module(f"{ROOT}.{COMMANDS[words[1]]}")
    result: int = module.main(words[2:])
    return result


if __name__ == "__main__":
    raise SystemExit(main(sys.argv))
