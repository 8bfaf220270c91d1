# SPDX-License-Identifier: GPL-3.0-or-later
"""The code that runs in pods, as files."""

from __future__ import annotations

import json
import zlib
from collections.abc import Mapping
from pathlib import Path

from ansible_collections.rosops.fleet.plugins.module_utils._pod.run import ARCHIVE, GZIP
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.pod_code import packed, pod_files


def write_code(directory: Path, changes: Mapping[str, str] | None = None) -> None:
    """What a ConfigMap's volume shows; `changes` are other modules in the archive, or other sources of them."""
    for name, content in pod_files().items():
        (directory / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    if changes:
        (directory / ARCHIVE).write_bytes(packed({**modules(), **changes}))


def modules() -> dict[str, str]:
    """Module -> source, of those in the archive."""
    held = pod_files()[ARCHIVE]
    assert isinstance(held, bytes)
    return dict(json.loads(zlib.decompress(held, GZIP)))
