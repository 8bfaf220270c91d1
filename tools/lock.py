# SPDX-License-Identifier: GPL-3.0-or-later
"""The Python packages of a fleet's own repository, each with one version and the sums of its files.

    pip install uv; python tools/lock.py

Versions are those that this project is tested with (requirements.txt). pip refuses a file with another sum.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

CHECKOUT = Path(__file__).resolve().parents[1]
REPOSITORY = CHECKOUT / "playbooks" / "files" / "repository"
CONTROL = ["ansible-core", *(CHECKOUT / "meta" / "ee-requirements.txt").read_text("utf-8").split()]
CI = ["ansible-lint", "molecule", "yamllint"]
HEADS = {
    "requirements.txt": "# what the control node needs; an execution environment of AWX has it from the collection\n",
    "requirements-test.txt": "# what CI needs besides requirements.txt; the lab of molecule comes from a checkout of "
    "the collection: docs/ci.md\n",
}
COMMAND = ["uv", "pip", "compile", "--quiet", "--universal", "--generate-hashes", "--python-version", "3.11",
           "--no-header", "--no-annotate", "-c", "requirements.txt", "-"]  # fmt: skip


def locked(packages: list[str]) -> dict[str, str]:
    """Package -> its lines, of all that these need on any system."""
    done = subprocess.run(  # noqa: S603
        COMMAND, cwd=CHECKOUT, input="\n".join(packages), stdout=subprocess.PIPE, text=True, check=True
    )
    entries = done.stdout.replace("\n    --hash", "\0    --hash").splitlines()
    return {entry.partition("==")[0]: entry.replace("\0", "\n") + "\n" for entry in entries}


def main() -> int:
    control, both = locked(CONTROL), locked([*CONTROL, *CI])
    for name, found in zip(HEADS, (control, {key: both[key] for key in both if key not in control}), strict=True):
        (REPOSITORY / name).write_text(HEADS[name] + "".join(found.values()), "utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
