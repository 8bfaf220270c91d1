# SPDX-License-Identifier: GPL-3.0-or-later
"""The app's parameters: set before it starts, and taken away with the node that they are private to.

A private one stands under the name that this very version's node has, so that a version beside it keeps its own. After
a version with a name of its own nothing is left under that name, whatever its node set there itself; after one whose
name the next version has, too, only what the inventory said. What the next one is to find as it was at run time is
looked up before the inventory's are set, and left by a version that ends before the next one begins (`kept_params`).
"""

from __future__ import annotations

import os
import sys
from typing import Iterable, Mapping

from .._common.errors import RefusalError, RosError
from .._ros.client import Ros1Client
from .._ros.rpc import Request
from .kept_params import PRIVATE, Space, Values, full, merge, tree_of
from .state import CALLER, Settings, load_settings, ros_of

SECONDS = 5.0  # for the master


def set_all(environ: Mapping[str, str]) -> str:
    """Why a parameter could not be set; nothing if all are."""
    settings = load_settings(environ)
    wanted = {full(name, settings.node): value for name, value in settings.params.items()}
    spent: list[str] = []
    try:
        ros = ros_of(environ, SECONDS)
        if settings.keep_params:
            wanted, spent = _with_kept(wanted, settings, ros)
        results = ros.calls(_change(spent, wanted))
    except RosError as error:
        return str(error)
    set_ones = zip(wanted, results[len(spent) :])
    return "; ".join(f"{name}: {result}" for name, result in set_ones if isinstance(result, RosError))


def forget(settings: Settings, seconds: float) -> None:
    """Take them off the server. What is not there is no error: most nodes have none."""
    node, keep = settings.node, [name for name in settings.keep_params if name.startswith(PRIVATE)]
    names = [full(name, node) for name in settings.params if name.startswith(PRIVATE)]
    if settings.version and node.endswith(f"_{settings.version}"):
        names = [node]  # all that is below it
    left: Values = {}
    if keep:
        seconds /= 2  # a question, and what follows from it
        space = _look(ros_of(os.environ, seconds), settings, keep)
        names.append(space.place)
        left = space.left(keep)
    if names:
        ros_of(os.environ, seconds).calls(_change(names, left))


def _change(gone: Iterable[str], values: Values) -> list[Request]:
    return [*(("deleteParam", CALLER, name) for name in gone), *(("setParam", CALLER, *one) for one in values.items())]


def _with_kept(given: Values, settings: Settings, ros: Ros1Client) -> tuple[Values, list[str]]:
    """What is to be set, and what is to be taken away before; the log is told where the inventory does not decide."""
    space = _look(ros, settings, settings.keep_params)
    source = space.source()
    merged = merge(given, space.found(settings.keep_params, source), settings.node)
    for words in (
        source.doubt,
        f"kept as they were, not as params say: {', '.join(merged.kept)}" if merged.kept else "",
        f"not kept: {'; '.join(merged.refused.values())}" if merged.refused else "",
    ):
        if words:
            sys.stderr.write(f"rosops.fleet: {words}\n")
    private = [name for name in settings.keep_params if name.startswith(PRIVATE)]
    taken = [name for name in private if merged.takes(full(name, settings.node))]
    return {**merged.values, **space.claim(taken)}, space.spent(taken, source)


def _look(ros: Ros1Client, settings: Settings, keep: Iterable[str]) -> Space:
    """The node's namespace as the server has it, and what of these is everybody's."""
    parent = settings.node.rpartition("/")[0]
    names = [parent or "/", *(name for name in keep if not name.startswith(PRIVATE))]
    state, *values = ros.calls([("getSystemState", CALLER), *(("getParam", CALLER, name) for name in names)])
    for result in (state, *values):
        if isinstance(result, RosError) and (result is state or not isinstance(result, RefusalError)):
            raise result  # a refusal to tell a parameter: there is none
    found = {name: value for name, value in zip(names, values) if not isinstance(value, RosError)}
    space = found.pop(names[0], {})
    inside = space.items() if isinstance(space, dict) else ()
    tree = tree_of({**found, **{f"{parent}/{name}": value for name, value in inside}})
    return Space(settings.node, settings.version, tree, ros.state_of(state).nodes())
