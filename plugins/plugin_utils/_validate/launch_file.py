# SPDX-License-Identifier: GPL-3.0-or-later
"""What a launch file says, from its text alone: nodes, arguments, and what would be refused at its start. Pure.

Nothing of it is run or opened. What only roslaunch can fill in (`$(find)`, `$(env)`, `$(eval)`) stays as it is written,
and an include is not followed: who reads this must judge nothing by what is not known.

Sources: wiki.ros.org/roslaunch/XML; roslaunch 1.15 (`xmlloader.py`, `loader.py`, `substitution_args.py`, `config.py`).
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from xml.parsers import expat

from ...module_utils._ros.names import resolve
from .._model.finding import Problem

HERE = ("localhost", "::1")
_LEFT = "$("  # begins what only roslaunch can fill in
_ARG = re.compile(r"\$\(\s*arg\s+([^\s()]+)\s*\)")
_BOOLEANS = {"true": True, "1": True, "false": False, "0": False}
_DEVICE = re.compile(r"/dev/(?!(?:null|zero|full|u?random|std(?:in|out|err))$|shm/|fd/)\S")
_HOLDERS = ("launch", "group")  # of all elements that are looked at, but for a node's parameters
_NODE_WORDS = ("pkg", "type", "name")
LONGEST = 2000  # of a value; arguments made of arguments could grow without an end


def is_known(text: str) -> bool:
    return _LEFT not in text


@dataclass
class Node:
    """A `<node>` by its full name. `place` is where it stands, `devices` what its arguments and parameters name.

    `sure`: there is no condition on it of which nobody knows here whether it holds.
    """

    name: str
    package: str
    type: str
    args: str = ""
    machine: str = ""
    place: str = ""
    sure: bool = True
    devices: list[str] = field(default_factory=list)

    @property
    def words(self) -> list[str]:
        """Its arguments; none where roslaunch could not take them apart either."""
        try:
            return shlex.split(self.args)
        except ValueError:  # a quotation mark without its other one
            return []

    @property
    def program(self) -> tuple[str, str]:
        """Package and type of what does its work: a nodelet's own, not those of what loads it."""
        words = self.words
        if self.package == "nodelet" and words[:1] in (["load"], ["standalone"]) and len(words) > 1:
            package, _slash, kind = words[1].partition("/")
            return package, kind
        return self.package, self.type

    @property
    def manager(self) -> str:
        """The full name of the manager that a nodelet is loaded into; empty: it is none, or nobody knows."""
        words = self.words
        if self.package != "nodelet" or words[:1] != ["load"] or len(words) < 3 or not is_known(words[2]):
            return ""
        return resolve(words[2], self.name.rpartition("/")[0], self.name)


@dataclass
class LaunchFile:
    """`takes` are the arguments that it has a use for; `problems` have their paths below the app's `launch`.

    `whole`: it includes no other file. `passes_all`: an include gets all arguments, so that any may have a use.
    """

    nodes: list[Node] = field(default_factory=list)
    takes: set[str] = field(default_factory=set)
    problems: list[Problem] = field(default_factory=list)
    whole: bool = True
    passes_all: bool = False


def read(path: str, text: str, args: Mapping[str, str], namespace: str = "/") -> LaunchFile:
    """The file at `path` with this text, as it is launched with these arguments in this ROS namespace."""
    reader, parser = _Reader(path, args, namespace), expat.ParserCreate()
    parser.StartElementHandler = lambda tag, attributes: reader.start(tag, attributes, parser.CurrentLineNumber)
    parser.EndElementHandler = reader.end
    parser.EntityDeclHandler = _refuse_entity
    try:
        parser.Parse(text, True)
    except expat.ExpatError as error:
        found = f"{path}, line {error.lineno}, is no XML: {expat.ErrorString(error.code)}"
        return LaunchFile(problems=[Problem("file", found, "the text of a launch file")], whole=False)
    except _EntityError as error:
        found = f"{path}, line {parser.CurrentLineNumber}, declares the entity {error}"
        return LaunchFile(problems=[Problem("file", found, "a launch file without entities of its own")], whole=False)
    reader.ended(text)
    return reader.file


class _EntityError(Exception):
    """An entity, which may stand for another file, or for a text that has no end."""


def _refuse_entity(name: str, *_rest: object) -> None:
    raise _EntityError(name)


@dataclass
class _Scope:
    """What an element hands on to those in it, but for its node. Arguments that a group declares end with it."""

    tag: str
    namespace: str
    args: dict[str, str]
    there: bool = True
    sure: bool = True
    node: Node | None = None


class _Reader:
    """Takes elements in the order of the text, as roslaunch does: an argument counts from where it is declared."""

    def __init__(self, path: str, given: Mapping[str, str], namespace: str) -> None:
        self.path, self.given = path, given
        self.scopes, self.file = [_Scope("", namespace, dict(given))], LaunchFile()
        self.machines: dict[str, str] = {}  # name -> address
        self.default_machine = ""

    def start(self, tag: str, attributes: Mapping[str, str], line: int) -> None:
        outer, place = self.scopes[-1], f"{self.path}, line {line}"
        said = {key: _filled(value, outer.args) for key, value in attributes.items()}
        holds = _holds(said) if outer.tag else True
        there, sure = outer.there and holds is not False, outer.sure and holds is not None
        scope = replace(outer, tag=tag, node=None, there=there, sure=sure)
        self.scopes.append(scope)
        if not outer.tag and tag != "launch":
            self._problem("file", f"{place}: begins with <{tag}>", "a launch file, which begins with <launch>")
        if tag == "arg" and outer.tag in _HOLDERS:
            self.file.takes.add(said.get("name", ""))  # also where its condition does not hold
        if there and outer.tag in _HOLDERS:
            self._element(scope, said, place)
        elif there and outer.node and tag == "param":
            outer.node.devices += _devices(said.get("value", "").strip())

    def end(self, _tag: str) -> None:
        self.scopes.pop()

    def ended(self, text: str) -> None:
        self.file.takes |= _used(text)
        for node in self.file.nodes:
            address = self.machines.get(node.machine, "" if self.file.whole else _LEFT)
            if node.machine and not _is_here(node.machine, address):
                found = f"{node.place}: {node.name} is to start on the machine {node.machine}"
                self._problem("file", found, "a node without machine=: all nodes of an app are in its pod")

    def _problem(self, key: str, found: str, allowed: str) -> None:
        self.file.problems.append(Problem(key, found, allowed))

    def _element(self, scope: _Scope, said: Mapping[str, str], place: str) -> None:
        if scope.tag == "arg":
            self._arg(scope, said, place)
        elif scope.tag == "group":
            scope.args, scope.namespace = dict(scope.args), resolve(said.get("ns", ""), scope.namespace)
        elif scope.tag == "node":
            self._node(scope, said, place)
        elif scope.tag == "include":
            self.file.whole = False
            self.file.passes_all |= said.get("pass_all_args", "false").lower() != "false"
        elif scope.tag == "machine":
            self.machines[said.get("name", "")] = said.get("address", "") if scope.sure else _LEFT
            if said.get("default", "").lower() == "true":
                self.default_machine = said.get("name", "")
        elif scope.tag == "master":
            allowed = "a launch file without it: the collection runs the ROS master"
            self._problem("file", f"{place}: has a <master>", allowed)

    def _arg(self, scope: _Scope, said: Mapping[str, str], place: str) -> None:
        name = said.get("name", "")
        if _holds(said) is None:
            if name not in self.given:
                scope.args.pop(name, None)
        elif "value" in said:
            if name in self.given and scope.sure:
                found = f"is given, but {place}, sets it with value="
                self._problem(f"args.{name}", found, "leave it out, or default= instead of value= in the launch file")
            scope.args[name] = said["value"]
        elif name not in scope.args:
            if "default" in said:
                scope.args[name] = said["default"]
            elif scope.sure:
                found = f"lacks {name}, for which {place}, has neither a value nor a default"
                self._problem("args", found, f"{name}, with a value")

    def _node(self, scope: _Scope, said: Mapping[str, str], place: str) -> None:
        lacks = [key for key in _NODE_WORDS if not said.get(key, "").strip()]
        if lacks:
            found = f"{place}: a <node> has no {' and no '.join(lacks)}"
            self._problem("file", found, "a <node> with pkg, type and name")
            return
        if "/" in said["name"] and is_known(said["name"]):
            found = f"{place}: the name {said['name']} of a <node> has a namespace in it"
            self._problem("file", found, "ns= beside the name")
            return
        name = resolve(said["name"], resolve(said.get("ns", ""), scope.namespace))
        machine = said.get("machine", "") or self.default_machine
        scope.node = Node(name, said["pkg"], said["type"], said.get("args", ""), machine, place, scope.sure)
        scope.node.devices += _devices(*(word.rpartition(":=")[2] for word in scope.node.words))
        self.file.nodes.append(scope.node)


def _devices(*values: str) -> list[str]:
    return [value for value in values if is_known(value) and _DEVICE.match(value)]


def _holds(said: Mapping[str, str]) -> bool | None:
    """Whether an element counts, by its `if` or `unless`; None: nobody knows here."""
    for key, wanted in (("if", True), ("unless", False)):
        if key in said:
            value = _BOOLEANS.get(said[key].lower().strip())
            return None if value is None else value == wanted
    return True


def _filled(text: str, args: Mapping[str, str]) -> str:
    """The text with the arguments that are known; as a whole an expression of Python stays as it is."""
    if text.startswith("$(eval "):
        return text
    found = _ARG.sub(lambda arg: args.get(arg[1], arg[0]), text)
    return found if len(found) <= LONGEST else text


def _is_here(name: str, address: str) -> bool:
    """Whether a machine is the pod itself, as far as it is known."""
    return not is_known(name + address) or (address or name) in HERE or address.startswith("127.")


def _used(text: str) -> set[str]:
    """Arguments that a launch file uses, declared or not: roslaunch takes them from the command line all the same."""
    found = set(re.findall(r"\$\(\s*arg\s+(\w+)", text))
    return found | set(re.findall(r"\w+", text)) if "$(eval " in text else found
