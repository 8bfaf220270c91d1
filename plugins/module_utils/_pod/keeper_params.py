# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Parameters as the keeper records and brings them back. Pure. Runs on Python 3.8, in pods."""

from __future__ import annotations

import xmlrpc.client
from typing import Any, Iterator, Mapping

# The master's own: roscore sets them anew, and they name the run.
OWN = frozenset({"run_id", "rosversion", "rosdistro", "roslaunch"})


def recorded(tree: Any) -> str:
    """The parameter tree as XML-RPC's own text: JSON has neither its dates nor its binary data."""
    kept = {key: value for key, value in tree.items() if key not in OWN} if isinstance(tree, Mapping) else {}
    return xmlrpc.client.dumps((kept,), allow_none=True)


def tree_of(text: str) -> dict[str, Any]:
    """The reverse of recorded()."""
    tree = xmlrpc.client.loads(text, use_builtin_types=False)[0][0] if text else {}
    return dict(tree) if isinstance(tree, Mapping) else {}


def absent(wanted: Mapping[str, Any], present: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """(name, value) of what `present` does not have. A value that is there is left as it is."""
    there = present if isinstance(present, Mapping) else {}
    for key, value in sorted(wanted.items()):
        if not path and key in OWN:
            continue
        name = f"{path}/{key}"
        if key not in there:
            yield name, value
        elif isinstance(value, Mapping) and isinstance(there[key], Mapping):
            yield from absent(value, there[key], name)
