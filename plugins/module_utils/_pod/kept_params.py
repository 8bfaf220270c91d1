# SPDX-License-Identifier: GPL-3.0-or-later
"""Which parameters of the version before win over those of the inventory. Pure; the server's tree is told to it.

Versions of one app are the nodes `<base>`, where all share the name, or `<base>_<version>`. What a version that ends
is to find again, or the next one, it leaves at a place of its own, `<base>_<version>_kept`, where no node reads it by
accident: `values`, and while it works beside others `names`, which tells those that it has taken theirs over. One that
works beside another and keeps less does not speak for it: should it be taken back, the other one's are there still.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass, field
from typing import Any, Collection, Dict, Iterable, Iterator

from .._ros.names import is_version

Values = Dict[str, Any]  # of parameters, by name; a mapping is a namespace

PRIVATE = "~"
_PLACE, _NAMES, _VALUES = "_kept", "names", "values"
_KINDS = ((bool, "true or false"), ((int, float), "a number"), (str, "a text"), (dict, "a mapping"), (list, "a list"))


def full(name: str, node: str) -> str:
    return f"{node}/{name[1:]}" if name.startswith(PRIVATE) else name


def value_at(tree: Any, name: str) -> Any:
    """What a tree of parameters has under a name, where a mapping is a namespace; None: nothing."""
    for word in _words(name):
        tree = tree.get(word) if isinstance(tree, dict) else None
    return tree


@dataclass(frozen=True)
class Source:
    """Below which name the version before has its parameters; or why none is taken."""

    root: str = ""
    doubt: str = ""
    over: bool = False  # that version has ended


@dataclass(frozen=True)
class Space:
    """The namespace in which the node of one version is."""

    own: str
    version: str
    tree: Values  # what of the server's is known
    registered: Collection[str]  # nodes

    @property
    def base(self) -> str:
        end = f"_{self.version}"
        return self.own[: -len(end)] if self.version and self.own.endswith(end) else self.own

    @property
    def place(self) -> str:
        return f"{self.base}_{self.version}{_PLACE}"

    @property
    def names(self) -> list[str]:
        """What has parameters in it, by whole names."""
        parent, slash, _own = self.own.rpartition("/")
        return [f"{parent}{slash}{name}" for name in value_at(self.tree, parent) or ()]

    @property
    def at_work(self) -> list[str]:
        return [name for name in self._versions(self.registered) if name != self.own]

    def _versions(self, names: Iterable[str]) -> list[str]:
        return sorted(name for name in names if is_version(name, self.base))

    def source(self) -> Source:
        """The version at work comes first. This one may have been there before, if only as a container that ended."""
        nodes, base = self._versions(self.names), self.base
        if self.at_work:
            return Source(next((name for name in self.at_work if name in nodes), ""))
        if self.own != base and self.own in nodes:
            return Source(self.own)
        places = self._versions(name[: -len(_PLACE)] for name in self.names if name.endswith(_PLACE))
        left = [name for name in nodes if name not in (self.own, base)]
        for root in (f"{name}{_PLACE}/{_VALUES}" for name in places if name != base):
            if value_at(self.tree, root) and not _below(root, self.place):
                left.append(root)
        if len(left) == 1:
            return Source(left[0], over=True)
        if base in nodes:
            return Source(base)
        why = f"none is kept of {', '.join(left)}, as each may be the version before"
        return Source(doubt=why if left else "")

    def found(self, keep: Iterable[str], source: Source) -> Values:
        """Whole name -> value of these: as this version left them, or the source; or as everybody has them."""
        roots = [f"{self.place}/{_VALUES}", *([source.root] if source.root else [])]
        found = {full(name, self.own): [value_at(self.tree, full(name, root)) for root in roots] for name in keep}
        there = {name: [value for value in values if value is not None] for name, values in found.items()}
        return {name: values[0] for name, values in there.items() if values}

    def spent(self, keep: Iterable[str], source: Source) -> list[str]:
        """What need not be left any longer, once this version has it."""
        spent = [self.place] if self.place in self.names else []
        if not source.over:
            return spent
        node, is_place, _rest = source.root.partition(f"{_PLACE}/")
        if not is_place:
            return [*spent, node, f"{node}{_PLACE}"]
        taken = [full(name, source.root) for name in keep]
        leaves = [leaf for leaf, _value in leaves_of(value_at(self.tree, source.root), source.root)]
        whole = all(any(_below(leaf, name) for name in taken) for leaf in leaves)
        return [*spent, *([f"{node}{_PLACE}"] if whole else taken)]

    def claim(self, keep: Iterable[str]) -> Values:
        """What tells the versions beside it that it has taken theirs over."""
        return {f"{self.place}/{_NAMES}": list(keep)} if self.own != self.base else {}

    def left(self, keep: Iterable[str]) -> Values:
        """Name -> value of what stays when this version ends: what none has taken over that is at work."""
        claims = [value_at(self.tree, f"{name}{_PLACE}/{_NAMES}") for name in self.at_work]
        names = [name for claim in claims if isinstance(claim, list) for name in claim]
        taken = [full(name, "") for name in names if isinstance(name, str)]
        found = {}
        for name in keep:
            value = value_at(self.tree, full(name, self.own))
            if value is not None and not any(_below(full(name, ""), other) for other in taken):
                found[full(name, f"{self.place}/{_VALUES}")] = value
        return found


@dataclass
class Merged:
    """What is set, whole name -> value; names where that is not what the inventory says; why others are not kept."""

    values: Values
    kept: list[str] = field(default_factory=list)
    refused: dict[str, str] = field(default_factory=dict)

    def takes(self, name: str) -> bool:
        """Whether nothing of it had to be refused."""
        return not any(_below(name, one) or _below(one, name) for one in self.refused)


def merge(given: Values, found: Values, own: str) -> Merged:
    """The inventory's parameters, and over them those that were found; both whole name -> value.

    What the inventory does not name is set besides where it is private to the node. What is everybody's is there.
    """
    result = Merged({})
    tree = _merged(tree_of(given), tree_of(found), "", result)
    result.values = {name: value_at(tree, name) for name in given}
    for name in found:
        for leaf, value in leaves_of(value_at(tree, name), name):
            if _below(leaf, own) and not any(_below(leaf, other) for other in given):
                result.values[leaf] = value
    return result


def _words(name: str) -> list[str]:
    return [word for word in name.split("/") if word]


def _below(name: str, other: str) -> bool:
    return f"{name}/".startswith(f"{other}/")


def tree_of(values: Values) -> Values:
    """As the server makes it of them, one set after the other."""
    root: Values = {}
    for name, value in values.items():
        *spaces, last = _words(name)
        space = root
        for word in spaces:
            if not isinstance(space.get(word), dict):
                space[word] = {}
            space = space[word]
        space[last] = copy.deepcopy(value)
    return root


def _merged(given: Any, found: Any, name: str, result: Merged) -> Any:
    if given is None:
        return found
    if isinstance(given, dict) and isinstance(found, dict):
        more = {key: _merged(given.get(key), value, f"{name}/{key}", result) for key, value in found.items()}
        return {**given, **more}
    if _kind(given) != _kind(found):
        result.refused[name] = f"{name} was {_kind(found)}, and params say {_kind(given)}"
        return given
    if given != found:
        result.kept.append(name)
    return found


def _kind(value: Any) -> str:
    return next((words for types, words in _KINDS if isinstance(value, types)), type(value).__name__)


def leaves_of(value: Any, name: str) -> Iterator[tuple[str, Any]]:
    if isinstance(value, dict) and value:
        for key, item in value.items():
            yield from leaves_of(item, f"{name}/{key}")
    elif value is not None:
        yield name, value
