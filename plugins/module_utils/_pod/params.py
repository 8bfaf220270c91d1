# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The app's parameters: set before it starts, and taken away with the node that they are private to.

A private one stands under the name that this very version's node has, so that a version beside it keeps its own. After
a version with a name of its own nothing is left under that name, whatever its node set there itself; after one whose
name the next version has, too, only what the inventory said.
"""

from __future__ import annotations

import os

from .._common.errors import RosError
from .own_node import CALLER, ros_of
from .state import load_settings

TYPE_CHECKING = False  # typing's own costs its import
if TYPE_CHECKING:
    from typing import Any, Mapping

PRIVATE = "~"
SECONDS = 5.0  # for the master


def full(name: str, node: str) -> str:
    """The parameter's whole name."""
    return f"{node}/{name[1:]}" if name.startswith(PRIVATE) else name


def assignments(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Whole name -> value."""
    return {full(name, settings["node"]): value for name, value in settings.get("params", {}).items()}


def leavings(settings: Mapping[str, Any], revision: str) -> list[str]:
    """What has to go with the node: names of parameters, or of a namespace of them."""
    node = settings["node"]
    if revision and node.endswith(f"_{revision}"):
        return [node]
    return [full(name, node) for name in settings.get("params", {}) if name.startswith(PRIVATE)]


def set_all(environ: Mapping[str, str]) -> str:
    """Why a parameter could not be set; nothing if all are."""
    wanted = assignments(load_settings(environ))
    try:
        results = ros_of(environ, SECONDS).calls([("setParam", CALLER, *one) for one in wanted.items()])
    except RosError as error:
        return str(error)
    return "; ".join(f"{name}: {result}" for name, result in zip(wanted, results) if isinstance(result, RosError))


def forget(settings: Mapping[str, Any], seconds: float) -> None:
    """Take them off the server. What is not there is no error: most nodes have none."""
    names = leavings(settings, os.environ.get("ROSOPS_REVISION", ""))
    if names:
        ros_of(os.environ, seconds).calls([("deleteParam", CALLER, name) for name in names])
