# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""JSON Schema's verdicts in words that somebody who runs robots understands: where, what is wrong, what is allowed."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.finding import Problem, join_path, shown, unique
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.formats import FORMS
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.secrets import is_secret

try:
    import jsonschema
except ImportError:
    jsonschema = None  # type: ignore[assignment,unused-ignore]

TYPE_WORDS = {
    "object": "a mapping",
    "array": "a list",
    "string": "text",
    "integer": "a whole number",
    "number": "a number",
    "boolean": "true or false",
    "null": "nothing",
}
BOUNDS = {
    "minimum": "{} or more",
    "maximum": "{} or less",
    "exclusiveMinimum": "more than {}",
    "exclusiveMaximum": "less than {}",
}


def schema_problems(value: Any, schema: Mapping[str, Any], path: str) -> list[Problem]:
    """Everything the schema finds wrong in the value, in the order of the paths; SpecError without jsonschema."""
    if jsonschema is None:
        raise SpecError("jsonschema is missing on the control node: `pip install jsonschema` beside ansible-core")
    checker = jsonschema.FormatChecker(formats=())
    for name, form in FORMS.items():
        checker.checks(name)(_format_test(form.test))
    validator = jsonschema.Draft202012Validator(schema, format_checker=checker)
    errors = sorted(validator.iter_errors(value), key=lambda error: [str(part) for part in error.absolute_path])
    return unique(problem for error in errors for problem in _explain(error, path))


def _format_test(test: Any) -> Any:
    # JSON Schema applies a format to texts only; other types are the type's business
    return lambda value: not isinstance(value, str) or test(value)


def plain(value: Any, path: str, problems: list[Problem]) -> Any:
    """The value with text keys and JSON's types only; what YAML can say beyond that becomes a problem.

    YAML reads `on:` as a key that is true, `2026-01-01` as a date and `8080:` as a key that is a number.
    """
    if isinstance(value, Mapping):
        for key in value:
            if not isinstance(key, str):
                problems.append(Problem(path, f"has the key {shown(key)}, which is no text", "keys in quotes"))
        return {str(key): plain(item, join_path(path, str(key)), problems) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item, join_path(path, index), problems) for index, item in enumerate(value)]
    if isinstance(value, float) and not math.isfinite(value):
        problems.append(Problem(path, f"is {value}", "a finite number"))
        return 0
    if value is None or isinstance(value, (bool, int, float)):
        return value
    if not isinstance(value, str):
        kind = next(name for name in (kind.__name__ for kind in type(value).__mro__) if name[0] != "_")  # Ansible's own
        problems.append(Problem(path, f"is a {kind}", "text (in quotes), a number, true or false, a list, a mapping"))
    return str(value)


def _explain(error: Any, base: str) -> Iterator[Problem]:
    path = join_path(base, *error.absolute_path)
    kind = error.validator
    if "propertyNames" in error.absolute_schema_path:
        yield Problem(path, f"has the key {shown(error.instance)}", _allowed(error.schema))
    elif kind == "additionalProperties":
        yield from _unknown_keys(error, path)
    elif kind == "required":
        for key in error.validator_value:
            if key not in error.instance:
                yield Problem(join_path(path, key), "is missing", _allowed(error.schema["properties"][key]))
    elif kind == "dependentRequired":
        for key, needed in error.validator_value.items():
            for other in needed:
                if key in error.instance and other not in error.instance:
                    yield Problem(
                        join_path(path, other), f"is missing, although {key} is set", f"{other} together with {key}"
                    )
    elif kind == "anyOf":
        yield from _best_branch(error, base, path)
    elif kind in ("minLength", "minItems"):
        yield Problem(path, "is empty", _allowed(error.schema))
    else:
        yield Problem(path, f"is {_value(error.instance, path)}", _allowed(error.schema))


def _value(value: Any, path: str) -> str:
    return "not acceptable" if isinstance(value, str) and is_secret(path) else shown(value)


def _unknown_keys(error: Any, path: str) -> Iterator[Problem]:
    known = list(error.schema["properties"])
    for key in sorted(set(error.instance) - set(known)):
        nearest = nearest_name(key, known)
        hint = f"; did you mean {nearest}?" if nearest else ""
        yield Problem(
            join_path(path, key),
            f"is unknown{hint}",
            "one of " + ", ".join(sorted(known)) if len(known) < 30 else "a variable of the collection's documentation",
        )


def nearest_name(name: str, known: Iterable[str], cutoff: float = 0.6) -> str | None:
    """The known name that a misspelt one most likely means."""
    found = difflib.get_close_matches(name, sorted(known), 1, cutoff)
    return found[0] if found else None


def _best_branch(error: Any, base: str, path: str) -> Iterator[Problem]:
    """Of alternatives the one of the value's own type speaks; if none has it, all are named."""
    depth = len(error.absolute_path)
    branches: dict[int, list[Any]] = {}
    for inner in error.context:
        branches.setdefault(inner.schema_path[0], []).append(inner)
    for inner_errors in branches.values():
        if not any(inner.validator == "type" and len(inner.absolute_path) == depth for inner in inner_errors):
            for inner in inner_errors:
                yield from _explain(inner, base)
            return
    yield Problem(path, f"is {_value(error.instance, path)}", _allowed(error.schema))


def _allowed(schema: Mapping[str, Any]) -> str:
    """A schema in words."""
    if "x-allowed" in schema:
        return str(schema["x-allowed"])
    if "enum" in schema:
        words = [str(choice) for choice in schema["enum"]]
        return " or ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)
    if "format" in schema:
        return FORMS[schema["format"]].allowed
    kinds = schema.get("type", "string")
    words_of_type = " or ".join(TYPE_WORDS[kind] for kind in ([kinds] if isinstance(kinds, str) else kinds))
    bounds = [words.format(schema[key]) for key, words in BOUNDS.items() if key in schema]
    empty = ", not empty" if schema.get("minLength") or schema.get("minItems") else ""
    return words_of_type + (", " + " and ".join(bounds) if bounds else "") + empty
