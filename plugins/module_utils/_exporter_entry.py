# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The entry of the exporter's pod, there as `run.py`: `python3 run.py exporter [--name value]..`.

It makes the directory that it appears in a package, and finds prometheus_client in the archive beside it.
"""

# ruff: noqa: PTH100, PTH118, PTH119, PTH120 - a script without pathlib, as the other entry
from __future__ import annotations

import importlib
import os
import sys

COMMANDS = {"exporter": "_exporter_run"}
ARCHIVE = "prometheus_client.zip"


def main(words: list[str]) -> int:
    if len(words) < 2 or words[1] not in COMMANDS:
        sys.stdout.write(f"usage: run.py {'|'.join(COMMANDS)}\n")
        return 2
    # not the real path: a ConfigMap's files are links, and the package is where they appear
    package = os.path.dirname(os.path.abspath(words[0]))
    sys.dont_write_bytecode = True  # it starts once, on a file system that cannot be written to
    sys.path[:0] = [os.path.dirname(package), os.path.join(package, ARCHIVE)]
    # ROS 1 knows no TLS. Without this, http.client would load OpenSSL, 4 MB that are never used.
    modules: dict[str, object] = sys.modules  # type: ignore[assignment]
    modules["ssl"] = None
    module = importlib.import_module(f"{os.path.basename(package)}.{COMMANDS[words[1]]}")
    result: int = module.main(words[2:])
    return result


if __name__ == "__main__":
    raise SystemExit(main(sys.argv))
