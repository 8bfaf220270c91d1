# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The part of prometheus_client that the exporter uses, out of the control node's installation, as an archive.

Python imports from it as it is, so no image has to bring it. The files are unchanged, with their licence; the package's
`__init__.py` is not among them, as it would load all the others. The bytes depend on the files alone: nothing
is compressed and every date is the same, so that a second run changes nothing, on another control node either.
"""

from __future__ import annotations

import functools
import importlib.metadata
import io
import zipfile

from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError

PACKAGE = "prometheus_client"
MODULES = (
    "metrics_core.py",
    "openmetrics/__init__.py",
    "openmetrics/exposition.py",
    "registry.py",
    "samples.py",
    "utils.py",
)
LICENCES = ("LICENSE", "NOTICE")
# The first release without Python 3.8, which the pods of ROS 1 have.
TOO_NEW = (0, 22)
NEEDED = "prometheus_client>=0.20,<0.22"
EPOCH = (1980, 1, 1, 0, 0, 0)


@functools.cache
def client_archive() -> bytes:
    """The archive; SpecError where prometheus_client is missing here, or is one that cannot be used."""
    try:
        found = importlib.metadata.distribution(PACKAGE)
    except importlib.metadata.PackageNotFoundError:
        raise SpecError(f"the ROS exporter needs {NEEDED} on the control node: `pip install '{NEEDED}'`") from None
    if _version(found.version) >= TOO_NEW:
        raise SpecError(f"prometheus_client {found.version} is not for Python 3.8, which pods have: use {NEEDED}")
    files = {str(path): path for path in found.files or ()}
    content: dict[str, str] = {}
    for module in MODULES:
        path = files.get(f"{PACKAGE}/{module}")
        if path is None:
            raise SpecError(f"prometheus_client {found.version} has no {module}: use {NEEDED}")
        content[f"{PACKAGE}/{module}"] = path.read_text()
    for name, path in files.items():
        if name.rpartition("/")[2] in LICENCES:
            content[f"{PACKAGE}/{name.rpartition('/')[2]}"] = path.read_text()
    return _archive(content)


def _version(text: str) -> tuple[int, ...]:
    return tuple(int(part) for part in text.split(".")[:2] if part.isdigit())


def _archive(content: dict[str, str]) -> bytes:
    """Stored, in order; directories have entries of their own, by which Python 3.8 finds a package without a file."""
    directories = {f"{name.rpartition('/')[0]}/" for name in content}
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_STORED) as archive:
        for name in sorted({*directories, *content}):
            info = zipfile.ZipInfo(name, EPOCH)
            info.create_system = 3
            archive.writestr(info, content.get(name, ""))
    return buffer.getvalue()
