# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What of an app two pods cannot have at once, so that its versions must not overlap. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

MANY_WRITERS = "ReadWriteMany"


def unshared(devices: Sequence[str], host_network: bool, resources: Any, overrides: Any) -> list[str]:
    """Why two pods of an app with these keys cannot be up at once; volumes aside."""
    found = [f"{device} is one device, and the two would both drive it" for device in devices]
    if host_network:
        found.append("host_network gives both the same ports of one host")
    found += [f"{name} is given to one of them, and the other is never placed" for name in _extended(resources)]
    for path, value in _leaves(overrides):
        if path[-1] == "hostPort" and value:
            found.append(f"host port {value} can be one pod's only")
        if path[-1] == "hostNetwork" and value is True:
            found.append("hostNetwork gives both the same ports of one host")
    found += [f"{name} is given to one of them, and the other is never placed" for name in _extended(overrides)]
    return list(dict.fromkeys(found))


def unshared_volume(name: str, access_mode: str, careful: bool) -> str:
    """Why two pods of an app cannot both mount a volume, wherever they are; nothing where they can.

    `careful`: it is mounted read-only, or its writers are known not to disturb each other.
    """
    if access_mode == "ReadWriteOncePod":
        return f"{name} is {access_mode}: one pod's only"
    return "" if careful or access_mode == MANY_WRITERS else f"both would write to {name}"


def _extended(value: Any) -> list[str]:
    """Resources of a device plugin (`nvidia.com/gpu`) among requests and limits, wherever these are."""
    return [
        str(path[-1])
        for path, amount in _leaves(value)
        if len(path) > 1 and path[-2] in ("requests", "limits") and "/" in str(path[-1]) and str(amount) != "0"
    ]


def _leaves(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[tuple[Any, ...], Any]]:
    """Path and value of everything in mappings and lists of any shape; what null removes is not there."""
    if isinstance(value, Mapping):
        for key, item in value.items():
            yield from _leaves(item, (*path, key))
    elif isinstance(value, (list, tuple)):
        for index, item in enumerate(value):
            yield from _leaves(item, (*path, index))
    elif path and value is not None:
        yield path, value
