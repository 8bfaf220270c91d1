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
from typing import Iterable, Mapping, Sequence

from .._common.errors import RefusalError, RosError
from .._ros.client import Ros1Client
from .._ros.rpc import Request
from .kept_params import PRIVATE, Space, Values, full, merge
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
        space, _public = _look(ros_of(os.environ, seconds), node, settings.version, [])
        names.append(_whole(space.place, node))
        left = {_whole(name, node): value for name, value in space.left(keep).items()}
    if names:
        ros_of(os.environ, seconds).calls(_change(names, left))


def _change(gone: Iterable[str], values: Values) -> list[Request]:
    return [*(("deleteParam", CALLER, name) for name in gone), *(("setParam", CALLER, *one) for one in values.items())]


def _whole(name: str, node: str) -> str:
    """The whole name of what stands in the node's namespace."""
    return f"{node.rpartition('/')[0]}/{name}"


def _with_kept(given: Values, settings: Settings, ros: Ros1Client) -> tuple[Values, list[str]]:
    """What is to be set, and what is to be taken away before; the log is told where the inventory does not decide."""
    node, keep = settings.node, [name for name in settings.keep_params if name.startswith(PRIVATE)]
    space, public = _look(ros, node, settings.version, [name for name in settings.keep_params if name not in keep])
    source = space.source()
    found = {_whole(name, node): value for name, value in space.found(keep, source).items()}
    merged = merge(given, {**public, **found}, node)
    for words in (
        source.doubt,
        f"kept as they were, not as params say: {', '.join(merged.kept)}" if merged.kept else "",
        f"not kept: {'; '.join(merged.refused.values())}" if merged.refused else "",
    ):
        if words:
            sys.stderr.write(f"rosops.fleet: {words}\n")
    taken = [name for name in keep if merged.takes(full(name, node))]
    claim = {_whole(name, node): value for name, value in space.claim(taken).items()}
    return {**merged.values, **claim}, [_whole(name, node) for name in space.spent(taken, source)]


def _look(ros: Ros1Client, node: str, version: str, public: Sequence[str]) -> tuple[Space, Values]:
    """The node's namespace as the server has it, and those of these parameters that are there."""
    parent, _slash, own = node.rpartition("/")
    names = [parent or "/", *public]
    state, *values = ros.calls([("getSystemState", CALLER), *(("getParam", CALLER, name) for name in names)])
    for result in (state, *values):
        if isinstance(result, RosError) and (result is state or not isinstance(result, RefusalError)):
            raise result  # a refusal to tell a parameter: there is none
    tree, *values = [None if isinstance(value, RosError) else value for value in values]
    nodes = [name.rpartition("/") for name in ros.state_of(state).nodes()]
    registered = [name for where, _slash, name in nodes if where == parent]
    space = Space(own, version, tree if isinstance(tree, dict) else {}, registered)
    return space, {name: value for name, value in zip(public, values) if value is not None}
