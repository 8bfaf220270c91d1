# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""An app's launch files against what the app says of them, where their text is in the inventory. Pure.

Where it is in the image only, nothing is judged here: what the graph of the robot shows is judged when it is updated.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from ...module_utils._pod.launch import named
from .._model.app import App, File, Launch, env_value
from .._model.finding import Problem
from .launch_file import LaunchFile, Node, is_known, read
from .single_nodes import why_single


def launch_problems(app: App, launch: Launch, namespace: str) -> Iterator[Problem]:
    """Problems of the launch files that can be read; `namespace` is where their nodes are."""
    args = {name: str(env_value(value)) for name, value in launch.args.items()}
    # roslaunch takes no argument without a value from its command line
    given = {name: value for name, value in args.items() if value.strip()}
    texts = [item for file in launch.file if (item := written(app.files, launch.package, file))]
    files = [read(item.path, item.content, given, namespace) for item in texts]
    nodes = [node for file in files for node in file.nodes if is_known(node.name)]
    found = [*(problem for file in files for problem in file.problems), *_twice(nodes)]
    if not found and len(files) == len(launch.file):
        found += _unknown_args(launch, files)
    if not found and app.handoff == "overlap":
        whole = len(files) == len(launch.file) and all(map(_is_whole, files))
        found += [*(_unknown_nodes(launch, nodes) if whole else ()), *_verdicts(launch, nodes, whole)]
    return (problem.below("launch") for problem in found)


def written(files: Sequence[File], package: str, name: str) -> File | None:
    """The item with the text of a launch file: that at its whole path, or the only one below the package's directory,
    where roslaunch finds it at any depth."""
    if name.startswith("/"):
        found = [item for item in files if item.path == name]
    else:
        below = f"/{package}/"
        found = [
            item for item in files if below in item.path and f"/{item.path.partition(below)[2]}".endswith(f"/{name}")
        ]
    return found[0] if len(found) == 1 and not found[0].secret else None


def _is_whole(file: LaunchFile) -> bool:
    return file.whole and all(is_known(node.name) for node in file.nodes)


def _twice(nodes: Sequence[Node]) -> Iterator[Problem]:
    """roslaunch refuses them. Of two that depend on what is not known here only one may be there."""
    first: dict[str, Node] = {}
    for node in nodes:
        other = first.setdefault(node.name, node)
        if other is not node and other.sure and node.sure:
            found = f"{node.place}: {node.name} is at {other.place}, too"
            yield Problem("file", found, "each node with a name of its own")


def _unknown_args(launch: Launch, files: Sequence[LaunchFile]) -> Iterator[Problem]:
    if any(file.passes_all for file in files):
        return
    takes = sorted(set().union(*(file.takes for file in files)))
    for name in launch.args:
        if name not in takes:
            allowed = "one of " + ", ".join(takes) if takes else "no args: it has no <arg>"
            yield Problem(f"args.{name}", "is no <arg> of the launch file", allowed)


def _unknown_nodes(launch: Launch, nodes: Sequence[Node]) -> Iterator[Problem]:
    names = list(dict.fromkeys(node.name for node in nodes))
    for key, words in (("replace", launch.replace), ("overlap", launch.overlap)):
        for index, word in enumerate(words):
            if not named(word, names):
                allowed = "one of " + ", ".join(names) if names else "leave it out"
                yield Problem(f"{key}[{index}]", f"is {word}, which the launch file does not start", allowed)


def _verdicts(launch: Launch, nodes: Sequence[Node], whole: bool) -> Iterator[Problem]:
    """`whole`: these are all nodes that there are."""
    names = {node.name for node in nodes}
    for node in nodes:
        who = f"lacks the node {node.name} ({'/'.join(node.program)})"
        if _listed(node, launch.replace):
            continue
        if whole and node.manager and node.manager not in names:
            found = f"{who}: the launch file does not start its manager {node.manager}, which takes it only once"
            yield Problem("replace", found, "list it in launch.replace, or handoff: replace")
        elif not _listed(node, launch.overlap) and (reason := why_single(node)):
            allowed = "list it in launch.replace, or in launch.overlap if two of it do no harm"
            yield Problem("replace", f"{who}: {reason}", allowed)


def _listed(node: Node, words: Sequence[str]) -> bool:
    return any(named(word, [node.name]) for word in words)
