# SPDX-License-Identifier: GPL-3.0-or-later
"""The kinds of the variables, and what is wrong with values of another kind, in words that somebody who runs robots
understands: where, what, and what is allowed.

The kinds are of apps and volumes their types (`_model/app.py`), of the others keys, types and choices from the argument
specs, and forms from here.
"""

from __future__ import annotations

import difflib
import functools
import math
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import MISSING
from types import NoneType
from typing import Annotated, Any, Literal, Union

from .._model.app import NODE_PORT, SIZE, App, AppName, Condition, Filled, Quantities, Volume
from .._model.finding import Problem, each, join_path, shown
from .._model.formats import FILLED, Form, words
from .._model.formats import FORMS as KNOWN
from .._model.keys import OPEN, Key, Kind, either, kind_of, text
from .._model.merge import APPS, LAYERS
from .._model.role_specs import Option, all_options


def or_empty(form: str) -> Kind:
    """A text of a form; empty is the roles' default and says the same as leaving it out."""
    known = KNOWN[form]
    return either("text", Annotated[str, Form(lambda value: not value or known.test(value), known.allowed)])


def numeral(of: type, least: float = -math.inf) -> Kind:
    """A number from there on, or the text of one."""
    digits = "[0-9]+" if of is int else r"[0-9]+(\.[0-9]+)?"
    allowed = ("a whole number" if of is int else "a number") + (", 0 or more" if least == 0 else "")
    number = Form(lambda value: float(value) >= least, allowed)
    text = Form(lambda value: re.fullmatch(f"-?{digits}", value) and number.test(value), allowed)
    return Kind(Union, (Kind(of, (), (number,)), Kind(str, (), (text,))), (words(allowed),))


# An empty answer of AWX's survey is nothing to ansible-core.
NAMES = either("a list of names, also as a text such as 'camera, lidar'", tuple[str, ...], str, NoneType)
LIMITS = ("default", "defaultRequest", "max", "min", "maxLimitRequestRatio")
LOGIN = ("registry", "username", "password")

# Variables that are no role's.
OWN = {
    "fleet_name": text("dns-name"),
    "fleet_kubeconfig_dir": kind_of(Filled),
    "robot_mode": kind_of(Literal["agent", "standalone"]),
}

# What an argument spec cannot say, by the path of the value. A kind stands for what the spec says, a note adds to that.
FORMS: dict[str, object] = {
    **{f"{layer}[]": Kind(dict, {"name": Key(kind_of(AppName), MISSING)}, (OPEN,)) for layer in LAYERS},
    APPS: kind_of(tuple[App, ...]),
    **dict.fromkeys(("collect_claims", "collect_match", "collect_robots", "update_apps", "update_remove_apps"), NAMES),
    "update_to": kind_of(str | float | None),
    "update_when[]": kind_of(Condition),
    "update_windows[].days": FILLED,
    "update_windows[].from": text("time-of-day"),
    "update_windows[].to": text("time-of-day"),
    "update_timezone": text("time-zone"),
    "persistent_storage.volumes": kind_of(tuple[Volume, ...]),
    "k3s_version": text("k3s-version"),
    "k3s_node_ip": or_empty("addresses"),
    "ros_master_image": text("image"),
    "ros_master_uri": or_empty("master-uri"),
    "ros_master_placement": words("local or remote"),
    "ros_master_goal_forwarding": kind_of(bool),
    "node_labels": kind_of(Mapping[Annotated[str, KNOWN["label-name"]], Annotated[str, KNOWN["label-value"]]]),
    "node_taints[].key": text("label-name"),
    "node_taints[].value": text("label-value"),
    "robot_namespace_admits[]": text("network"),
    "robot_namespace_quota": kind_of(Quantities),
    **dict.fromkeys([f"robot_namespace_limits.{key}" for key in LIMITS], kind_of(Quantities)),
    # which keys need which others
    "robot_namespace_pull_secrets[]": {"registry": LOGIN[1:], "username": LOGIN[:1], "password": LOGIN[:1]},
    "robot_namespace_pull_secrets[].name": text("dns-name"),
    **dict.fromkeys([f"robot_namespace_pull_secrets[].{key}" for key in LOGIN], kind_of(Filled)),
    **{f"observability{end}": text("retention") for end in (
        ".prometheus.scrape_interval", ".prometheus.evaluation_interval", ".prometheus.retention", ".loki.retention",
    )},
    **{f"observability{end}": SIZE for end in (
        ".grafana.persistence.size", ".loki.persistence.size", "_prometheus_size", "_store_size",
    )},
    **{f"observability_{part}_port": kind_of(Annotated[int, NODE_PORT]) for part in (
        "grafana_node", "hub_metrics", "hub_logs",
    )},
    **{f"observability_images.{part}": text("image") for part in all_options()["observability_images"]["options"]},
    "observability_hub_url": or_empty("hub-url"),
    "observability_tls_secret_name": or_empty("dns-name"),
    "observability_allowed_networks[]": text("network"),
    "observability_log_shipper": words("otelcol, which took promtail's place and its labels, or none"),
}  # fmt: skip

# What is inside a mapping has the type that YAML gave it.
STRICT: dict[str, object] = {"str": str, "path": str, "raw": Any, "int": int, "float": float, "bool": bool}
# A variable that `-e name=value` gives is a text, so Ansible's own conversions are followed.
BOOLEANS = ("true", "false", "yes", "no", "on", "off", "1", "0")
LENIENT = {
    **{name: kind_of(hint) for name, hint in STRICT.items()},
    "str": kind_of(str | float),
    "int": numeral(int),
    "float": numeral(float),
    "bool": Kind(Any, (), (Form(lambda said: str(said).lower() in BOOLEANS, "true or false"),)),
}
TIMES = ("_timeout", "_seconds")
SECONDS = {kind: numeral(of, 0) for kind, of in (("int", int), ("float", float))}


@functools.cache
def variables() -> dict[str, Kind]:
    """The kind of each of the fleet's variables."""
    return {**{name: kind_of_option(option, name) for name, option in all_options().items()}, **OWN}


def of_host() -> Kind:
    """The kind of one host's variables."""
    return Kind(dict, {name: Key(kind) for name, kind in variables().items()})


def kind_of_option(option: Option, path: str) -> Kind:
    """The kind of an argument spec's option, with the forms at and below its path."""
    form, kind = FORMS.get(path), _plain(option, path)
    return kind._replace(notes=(*kind.notes, form)) if form else kind


def needed(name: str) -> bool:
    """Whether the validation itself has to read a variable: it has a form, or robots are made of it."""
    return (
        name in OWN
        or name.startswith(("ros_master_", "robot_namespace_"))
        or any(path == name or path.startswith((f"{name}.", f"{name}[")) for path in FORMS)
    )


def _plain(option: Option, path: str) -> Kind:
    kind = option.get("type", "str")
    if kind == "list":
        return Kind(tuple, (kind_of_option({**option, "type": option.get("elements", "raw")}, f"{path}[]"),))
    if "choices" in option:
        return Kind(Literal, tuple(option["choices"]))
    if kind != "dict":
        if "." not in path and path.endswith(TIMES):
            return SECONDS[kind]
        # YAML takes 007 for a number; a secret has to be written as the text it is
        return kind_of(STRICT[kind]) if "." in path or option.get("no_log") else LENIENT[kind]
    if "options" not in option:
        return kind_of(Mapping[str, Any])
    return Kind(
        dict,
        {
            name: Key(kind_of_option(inner, f"{path}.{name}"), MISSING if inner.get("required") else None)
            for name, inner in option["options"].items()
        },
    )


# Type -> whose values it takes, and its words; all others are mappings.
TYPES: dict[Any, tuple[Any, str]] = {
    str: (str, "text"),
    int: (int, "a whole number"),
    float: ((int, float), "a number"),
    bool: (bool, "true or false"),
    NoneType: (NoneType, "nothing"),
    tuple: (list, "a list"),
}
MAPPING = (dict, "a mapping")


def value_problems(value: Any, kind: Kind, path: str) -> list[Problem]:
    """Everything that is wrong with a value, in the order of the paths."""
    return [*dict.fromkeys(sorted(_wrong(value, kind.said, path), key=lambda problem: problem.path))]


def _wrong(value: Any, kind: Kind, path: str) -> Iterator[Problem]:
    forms = [note for note in kind.notes if isinstance(note, Form)]
    of_its_type = [one for one in kind.inner if fits(value, one)] if kind.type is Union else []
    if of_its_type:
        yield from _wrong(value, of_its_type[0], path)
    elif not fits(value, kind) or not all(form.test(value) for form in forms):
        found = "empty" if FILLED in forms and fits(value, kind) else shown(value)
        yield Problem(path, f"is {found}", allowed(kind))
    elif kind.type is tuple:
        for where, item in each(path, value):
            yield from _wrong(item, kind.inner[0].said, where)
    elif kind.type is Mapping:
        names, values = kind.inner
        for name, item in value.items():
            if any(_wrong(name, names, path)):
                yield Problem(path, f"has the key {shown(name)}", allowed(names))
            yield from _wrong(item, values.said, join_path(path, name))
    elif isinstance(kind.inner, Mapping):
        yield from _of_mapping(value, kind, path)


def fits(value: Any, kind: Kind) -> bool:
    """Whether a value is of a type. Of numbers it is the value that counts: 2.0 is a whole one."""
    if kind.type is Any:
        return True
    if kind.type is Literal:
        return value in kind.inner
    if kind.type is Union:
        return any(fits(value, one) for one in kind.inner)
    if isinstance(value, bool):
        return kind.type is bool
    if kind.type is int and isinstance(value, float):
        return value.is_integer()
    return isinstance(value, TYPES.get(kind.type, MAPPING)[0])


def _of_mapping(value: Mapping[str, Any], kind: Kind, path: str) -> Iterator[Problem]:
    """Mappings are closed: a key that nobody reads is a mistake that nobody would see."""
    known: Mapping[str, Key] = kind.inner
    for name, key in known.items():
        if name in value:
            yield from _wrong(value[name], key.kind.said, join_path(path, name))
        elif key.required:
            yield Problem(join_path(path, name), "is missing", allowed(key.kind.said))
    for name in set(value) - set(known) if OPEN not in kind.notes else ():
        told = "a variable of the collection's documentation"
        if len(known) < 30:
            told = "one of " + ", ".join(sorted(known))
        yield Problem(join_path(path, name), f"is unknown{did_you_mean(name, known)}", told)
    needs = next((note for note in kind.notes if isinstance(note, Mapping)), {})
    for name, other in ((name, other) for name, others in needs.items() for other in others):
        if name in value and other not in value:
            found = f"is missing, although {name} is set"
            yield Problem(join_path(path, other), found, f"{other} together with {name}")


def allowed(kind: Kind) -> str:
    """A kind in words."""
    forms = [note for note in kind.notes if isinstance(note, Form)]
    if forms and forms[-1] is not FILLED:
        return forms[-1].allowed
    if kind.type is Literal:
        words = [str(choice) for choice in kind.inner]
        return " or ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)
    if kind.type is Union:
        return " or ".join(map(allowed, kind.inner))
    return ", ".join([TYPES.get(kind.type, MAPPING)[1], *(form.allowed for form in forms)])


def nearest_name(name: str, known: Iterable[str], cutoff: float = 0.6) -> str:
    """The known name that a misspelt one most likely means; empty where it is like none."""
    return next(iter(difflib.get_close_matches(name, sorted(known), 1, cutoff)), "")


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """The end of a finding about a name that nobody knows."""
    nearest = nearest_name(name, known)
    return f"; did you mean {nearest}?" if nearest else ""
