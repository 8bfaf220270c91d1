# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Texts of a Rigelfile with `{{ vars.x }}` filled in, as by Rigel, which still know how an inventory has them."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any, NamedTuple

from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.finding import join_path

# What Rigel takes for a variable; anything else within braces it hands on as text.
_PLAIN = re.compile(r"[\w\s\-!?.]+", re.ASCII)
_BRACES = re.compile(r"\{\{(.*?)\}\}", re.DOTALL)
_FILTERED = re.compile(r"\s*vars\.([\w\-!?.]+)\s*(\|.*)", re.ASCII | re.DOTALL)
_JINJA = re.compile(r"\{\{|\{%|\{#")


class Filled(str):
    """A text with its variables filled in; `template` is the same for an inventory."""

    template: str

    @classmethod
    def of(cls, value: str, template: str) -> Filled:
        made = cls(value)
        made.template = template
        return made

    def __deepcopy__(self, _memo: Any) -> Filled:
        return self


class Verbatim(str):
    """A text with braces that are nobody's variables: Ansible must not read it."""

    def __deepcopy__(self, _memo: Any) -> Verbatim:
        return self


class Variable(NamedTuple):
    """One that the inventory has: its name there, and its value there."""

    name: str
    value: Any


class Variables:
    """The Rigelfile's `vars`, and the environment behind them. `used` are those that the inventory needs."""

    def __init__(self, declared: Mapping[str, Any], environment: Mapping[str, str]) -> None:
        self.declared, self.environment = declared, environment
        self.used: dict[str, Variable] = {}
        self.read: set[str] = set()
        self.filtered: list[str] = []  # paths of texts with a filter, which Rigel would have handed on as text
        self._names: dict[str, str] = {}

    def filled(self, value: Any, path: str, within: tuple[str, ...] = ()) -> Any:
        """The value with every variable in it filled in, at any depth."""
        if isinstance(value, Mapping):
            return {
                str(self.filled(str(key), path, within)): self.filled(item, join_path(path, str(key)), within)
                for key, item in value.items()
            }
        if isinstance(value, list):
            return [self.filled(item, join_path(path, index), within) for index, item in enumerate(value)]
        return self._text(value, path, within) if isinstance(value, str) else value

    def _text(self, text: str, path: str, within: tuple[str, ...]) -> Any:
        if not _JINJA.search(text):
            return text
        alone = _BRACES.fullmatch(text.strip())
        if alone and _PLAIN.fullmatch(alone[1]):
            name = self._named(alone[1], path)
            found = self._value(name, path, within)
            return Filled.of(found, self._template(name, found)) if isinstance(found, str) else found
        values, templates, after = "", "", 0
        for match in _BRACES.finditer(text):
            value, template = self._piece(match, path, within)
            between = text[after : match.start()]
            values, templates, after = values + between + value, templates + between + template, match.end()
        values, templates = values + text[after:], templates + text[after:]
        ours = _JINJA.search(_BRACES.sub("", text)) is None and all(self._known(one) for one in _BRACES.findall(text))
        return Filled.of(values, templates) if ours else Verbatim(values)

    def _piece(self, match: re.Match[str], path: str, within: tuple[str, ...]) -> tuple[str, str]:
        """What stands for one pair of braces: the value, and for an inventory."""
        if _PLAIN.fullmatch(match[1]):
            name = self._named(match[1], path)
            found = self._value(name, path, within)
            if isinstance(found, (list, dict)):
                raise SpecError(f"{path}: vars.{name} is no text that could stand within one; give it the whole value")
            return str(found), self._template(name, found)
        filtered = _FILTERED.fullmatch(match[1])
        if not filtered:
            return match[0], match[0]
        self.filtered.append(path)
        found = self._value(filtered[1], path, within)
        return match[0], "{{ " + self._inventory_name(filtered[1], found) + " " + filtered[2].strip() + " }}"

    @staticmethod
    def _known(inside: str) -> bool:
        return bool(_PLAIN.fullmatch(inside) or _FILTERED.fullmatch(inside))

    @staticmethod
    def _named(inside: str, path: str) -> str:
        header, _dot, name = "".join(inside.split()).partition(".")
        if header == "data":
            raise SpecError(
                f"{path}: {{{{ data.{name} }}}} is made by another job while Rigel runs, so nobody knows it here; "
                "write its value into the Rigelfile"
            )
        if header != "vars" or not name:
            raise SpecError(
                f"{path}: {{{{ {inside.strip()} }}}} is no variable of Rigel's; allowed: {{{{ vars.name }}}}"
            )
        return name

    def _value(self, name: str, path: str, within: tuple[str, ...]) -> Any:
        if name in within:
            raise SpecError(f"vars.{name}: is made of itself ({' -> '.join([*within, name])}); give it a value")
        self.read.add(name)
        if name in self.declared:
            return self.filled(self.declared[name], f"vars.{name}", (*within, name))
        if name in self.environment:
            return self.environment[name]
        raise SpecError(
            f"{path}: vars.{name} is neither under vars nor in the environment; declare it, or set it as for Rigel"
        )

    def _template(self, name: str, value: Any) -> str:
        return "{{ " + self._inventory_name(name, value) + " }}" if isinstance(value, str) else str(value)

    def _inventory_name(self, name: str, value: Any) -> str:
        made = "rigel_" + re.sub(r"\W", "_", name, flags=re.ASCII)
        if self._names.setdefault(made, name) != name:
            raise SpecError(f"vars.{name}: has the same letters as vars.{self._names[made]}; rename one of them")
        if name not in self.declared:
            value = Filled.of(value, "{{ lookup('ansible.builtin.env', '" + name + "', default=undef()) }}")
        self.used[name] = Variable(made, value)
        return made
