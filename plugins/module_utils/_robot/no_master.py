# SPDX-License-Identifier: GPL-3.0-or-later
"""The ROS master of a robot without ROS: the keeper itself, which says that nobody has registered anything.

So a robot without ROS is one whose graph is empty, for the keeper as for everybody who asks it.
"""

from __future__ import annotations

from typing import Any, Callable, Mapping

from .._common.documents import Data


def methods(uri: str) -> Mapping[str, Callable[..., list[Any]]]:
    """What is asked of a master of the Master API (wiki: ROS/Master_API), besides what every node answers."""
    nobody: Data = {}
    return {
        "getUri": lambda _caller: [1, "", uri],
        "getSystemState": lambda _caller: [1, "", [[], [], []]],
        "getTopicTypes": lambda _caller: [1, "", []],
        "getParam": lambda _caller, _key: [1, "", nobody],
    }
