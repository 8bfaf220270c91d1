# SPDX-License-Identifier: GPL-3.0-or-later
"""The rooms of plugins/, what each may import, and what is wrong with a tree that does not keep to it.

This table is the only one; docs/developing.md says what each room is for.
"""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterator
from pathlib import Path, PurePosixPath

from imports import absolute, imported, python_files

HOSTS, CONTROL = "module_utils", "plugin_utils"
OLDEST = (3, 8)  # the Python of hosts and pods

# Room -> rooms of the same half that it may import. The order is from the ground up.
HOST_ROOMS: dict[str, tuple[str, ...]] = {
    "_common": (),
    "_ros": ("_common",),
    "_step": ("_common", "_ros"),
    "_pod": ("_common", "_ros", "_step"),
    "_exporter": ("_common", "_ros"),
    "_robot": ("_common", "_ros", "_step", "_pod", "_exporter"),
    "_host": ("_common", "_ros", "_step"),
    "_rehearsal": (),
}
# These may import every room for hosts, too: what is applied and judged there is written here.
CONTROL_ROOMS: dict[str, tuple[str, ...]] = {
    "_upstream": (),
    "_model": ("_upstream",),
    "_kube": ("_upstream", "_model"),
    "_images": ("_model",),
    "_k3s": ("_model",),
    "_preflight": ("_model",),
    "_repository": (),
    "_objects": ("_model",),
    "_observability": ("_model", "_objects"),
    # above the objects: an app's overrides are judged by the object that they are laid over
    "_validate": ("_model", "_objects", "_observability"),
    "_update": ("_model", "_kube", "_images", "_objects", "_observability"),
    # what actions share: how they run modules on the host at hand, and what an update calls the ways in which they fail
    "_action": ("_upstream", "_model", "_kube", "_images", "_update"),
    "_rehearsal": (),
    "_report": ("_model", "_kube", "_objects", "_observability", "_update"),
}
# What is in `rosops-code`. In a pod is no Ansible.
POD_ROOMS = ("_common", "_ros", "_step", "_pod", "_exporter", "_robot")
# What runs on the Python of an image's own ROS has that at hand, too, beside the standard library.
ROS_OF_THE_IMAGE = {"_pod/launch": ("rosgraph", "roslaunch", "pipes"), "_rehearsal/stand_in": ("rospy", "genpy")}

_FILE = re.compile(r"[a-z][a-z0-9_]*\.py")


def wrongs(plugins: Path) -> list[str]:
    """What is wrong with the tree below `plugins`, one line each: where, and what to do."""
    found: list[str] = []
    for file, text in python_files(plugins):
        kind, *rest = file.parts[1:]
        if kind in (HOSTS, CONTROL):
            found += _place(file, kind, rest)
        if kind in (HOSTS, "modules"):
            found += _host_code(file, text)
        found += [
            f"{file}: imports {name}; {why}"
            for name in imported(file, text)
            if (why := _forbidden(kind, rest[0], name.split(".")))
        ]
    return found


def _place(file: PurePosixPath, kind: str, rest: list[str]) -> Iterator[str]:
    rooms = HOST_ROOMS if kind == HOSTS else CONTROL_ROOMS
    if len(rest) != 2 or rest[0] not in rooms:
        yield f"{file}: lies in no room of {kind}; they are {' '.join(rooms)}"
    if not _FILE.fullmatch(rest[-1]):
        yield f"{file}: a file is named by a plain noun; the underscore stands on the directory"


def _forbidden(kind: str, room: str, name: list[str]) -> str:
    """Why a file of `room` may not import a name; nothing where it may."""
    if name[0] != "plugins":
        return ""
    to_kind, to_room = name[1], name[2] if len(name) > 2 else ""
    if to_kind not in (HOSTS, CONTROL):
        return "" if kind == to_kind else f"nothing imports {to_kind}"
    if kind in (HOSTS, "modules") and to_kind == CONTROL:
        return f"{CONTROL} stays on the control node"
    if kind == to_kind and room != to_room:
        allowed = (HOST_ROOMS if kind == HOSTS else CONTROL_ROOMS).get(room, ())
        return "" if to_room in allowed else f"{room} stands on {' '.join(allowed) or 'nothing'}"
    return ""


def _host_code(file: PurePosixPath, text: str) -> Iterator[str]:
    """Of files that run on hosts and in pods: what the language and the library there do not have."""
    try:
        ast.parse(text, feature_version=OLDEST)
    except SyntaxError as error:
        yield f"{file}:{error.lineno}: not of Python {'.'.join(map(str, OLDEST))}: {error.msg}"
        return
    kind, room = file.parts[1:3]
    known = ("ansible", "ansible_collections", *ROS_OF_THE_IMAGE.get("/".join(file.with_suffix("").parts[2:]), ()))
    for module in absolute(text):
        top = module.partition(".")[0]
        if kind == HOSTS and top == "ansible_collections":
            yield f"{file}: imports {module}; by that name it is not found in a pod: import it relatively"
        elif top == "ansible" and room in POD_ROOMS:
            yield f"{file}: imports {module}; there is no Ansible in a pod"
        elif top not in (*known, *sys.stdlib_module_names):
            yield f"{file}: imports {module}; hosts have the standard library alone"
        elif top == "ansible" and not module.startswith("ansible.module_utils"):
            yield f"{file}: imports {module}; only ansible.module_utils goes to hosts"
