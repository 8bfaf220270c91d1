# SPDX-License-Identifier: GPL-3.0-or-later
"""Which version's values are kept, and how they are laid over the inventory's."""

from __future__ import annotations

import copy
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._pod.kept_params import Source, Space, merge, tree_of

REVISION = "22222222"
ONE, TWO, THREE = "arm_11111111", "arm_22222222", "arm_33333333"
LEFT, MINE = f"{ONE}_kept", f"{TWO}_kept"
STRANGERS = ["army_11111111", "arm_1111111", "arm_11111111x", "arm_left", "arm_kept", "army_11111111_kept"]


def space(own: str, tree: dict[str, Any], *registered: str) -> Space:
    return Space(own, REVISION, tree, [own, *registered])


BOTH = (TWO, "arm")


@pytest.mark.parametrize(
    ("owns", "there", "registered", "source"),
    [
        (BOTH, [], [], Source()),  # the first start
        (BOTH, STRANGERS, STRANGERS, Source()),
        (BOTH, [ONE], [ONE], Source(ONE)),  # it works: nothing of it is taken away
        (BOTH, [ONE], [], Source(ONE, over=True)),  # ended, or its registration is not back yet
        (BOTH, [ONE, TWO, THREE, "arm"], [THREE], Source(THREE)),
        (BOTH, [ONE, THREE], [ONE, THREE], Source(ONE)),  # both have what the version before had
        (BOTH, [THREE, LEFT, *STRANGERS], [ONE], Source()),  # that at work has none
        (BOTH, [LEFT], [], Source(f"{LEFT}/values", over=True)),
        (BOTH, [LEFT, MINE], [], Source(f"{LEFT}/values", over=True)),
        (BOTH, [LEFT, THREE], [THREE], Source(THREE)),
        (BOTH, [LEFT, "arm"], [], Source(f"{LEFT}/values", over=True)),
        (BOTH, [ONE, THREE, "arm"], [], Source("arm")),
        (BOTH, [LEFT, THREE], [],
         Source(doubt=f"none is kept of {THREE}, {LEFT}/values, as each may be the version before")),
        # another handoff, and one begun again
        ([TWO], [TWO, ONE, "arm"], [], Source(TWO)),  # its container once more
        ([TWO], [TWO, "arm"], ["arm"], Source("arm")),  # the one before had no name of its own
        (["arm"], ["arm"], [], Source("arm")),
        (["arm"], ["arm", TWO], [TWO], Source(TWO)),  # the one before had one
        ([TWO], [f"{TWO}_4", "arm"], [f"{TWO}_4"], Source(f"{TWO}_4")),  # another pod of the same revision
    ],
)  # fmt: skip
def test_whose_parameters_are_kept(owns: list[str], there: list[str], registered: list[str], source: Source) -> None:
    tree = {name: {"values": {"rate": 1}} if name.endswith("_kept") else {"rate": 1} for name in there}
    for own in owns:
        assert space(own, tree, *registered).source() == source


@pytest.mark.parametrize("own", [TWO, "arm"])
def test_each_comes_from_where_this_version_left_it_or_from_the_source(own: str) -> None:
    tree = {MINE: {"values": {"rate": 1, "off": 0}}, ONE: {"rate": 2, "pid": {"p": 3}, "other": 4}}
    found = space(own, tree).found(["~rate", "~off", "~pid/p", "~gone"], Source(ONE))
    assert found == {f"{own}/rate": 1, f"{own}/off": 0, f"{own}/pid/p": 3}


@pytest.mark.parametrize(
    ("keep", "source", "spent"),
    [
        (["~rate"], Source(), [MINE]),
        (["~rate"], Source(THREE), [MINE]),
        (["~rate"], Source(THREE, over=True), [MINE, THREE, f"{THREE}_kept"]),
        (["~rate"], Source(f"{LEFT}/values", over=True), [MINE, f"{LEFT}/values/rate"]),
        (["~rate", "~pid/p"], Source(f"{LEFT}/values", over=True), [MINE, LEFT]),
    ],
)
def test_what_is_taken_away(keep: list[str], source: Source, spent: list[str]) -> None:
    """What this version does not keep may be asked for by the one that left it."""
    tree = {MINE: {"names": []}, LEFT: {"values": {"rate": 1, "pid": {"p": 2}}}, THREE: {"rate": 1}}
    assert space(TWO, tree).spent(keep, source) == spent
    assert space("arm", tree).spent(keep, source) == spent


@pytest.mark.parametrize("own", [TWO, "arm"])
@pytest.mark.parametrize(
    ("keep", "at_work", "left"),
    [
        (["~rate", "~pid/p", "~gone"], {}, {"rate": 5, "pid/p": 2}),
        (["~rate", "~pid"], {THREE: None}, {"rate": 5, "pid": {"p": 2, "d": 1}}),
        (["~rate", "~pid"], {THREE: ["~pid/p"]}, {"rate": 5, "pid": {"p": 2, "d": 1}}),
        (["~rate", "~pid/p"], {THREE: ["~pid"]}, {"rate": 5}),
        (["~rate", "~pid"], {ONE: ["~rate"], THREE: ["~pid"]}, {}),
        (["~rate"], {THREE: "nonsense"}, {"rate": 5}),
        (["~rate"], {THREE: [5, ["~rate"]]}, {"rate": 5}),
        (["~rate"], {f"{THREE} ended": ["~rate"]}, {"rate": 5}),
    ],
)
def test_what_is_left(own: str, keep: list[str], at_work: dict[str, Any], left: dict[str, Any]) -> None:
    tree: dict[str, Any] = {own: {"rate": 5, "pid": {"p": 2, "d": 1}}}
    tree.update({f"{name.split()[0]}_kept": {"names": names} for name, names in at_work.items() if names is not None})
    found = space(own, tree, *(name for name in at_work if "ended" not in name)).left(keep)
    assert tree_of(found) == tree_of({f"{MINE}/values/{name}": value for name, value in left.items()})


P = "/arm/pid/p"
PID = {"p": 1.5, "i": 0.0}


@pytest.mark.parametrize(
    ("given", "found", "values", "kept"),
    [
        ({"/arm/rate": 50}, {}, {"/arm/rate": 50}, []),
        ({"/arm/rate": 50}, {"/arm/rate": 55}, {"/arm/rate": 55}, ["/arm/rate"]),
        ({"/arm/rate": 50}, {"/arm/rate": 50.5}, {"/arm/rate": 50.5}, ["/arm/rate"]),  # a number is a number
        ({"/arm/rate": 50}, {"/arm/rate": 50}, {"/arm/rate": 50}, []),
        ({"/arm/rate": 50}, {"/arm/other": 1}, {"/arm/rate": 50, "/arm/other": 1}, []),  # the node's own
        # a mapping: leaf by leaf, what is new comes, what was added stays
        ({"/arm/pid": PID}, {"/arm/pid": {"p": 2, "d": 1}}, {"/arm/pid": {"p": 2, "i": 0.0, "d": 1}}, [P]),
        ({"/arm/pid": PID}, {"/arm/pid/p": 2.0}, {"/arm/pid": {"p": 2.0, "i": 0.0}}, [P]),
        # written in two ways
        ({"/arm/pid/p": 1}, {"/arm/pid": {"p": 2, "d": {"x": 0}}}, {"/arm/pid/p": 2, "/arm/pid/d/x": 0}, [P]),
        ({"/arm/pid": PID, "/arm/pid/p": 3}, {}, {"/arm/pid": {"p": 3, "i": 0.0}, "/arm/pid/p": 3}, []),
        # all that is private
        ({"/arm/rate": 50}, {"/arm": {"rate": 5, "map": {"a": []}}}, {"/arm/rate": 5, "/arm/map/a": []}, ["/arm/rate"]),
        # everybody's: only what the inventory says is ours to set
        ({"/limits/speed": 1}, {"/limits": {"speed": 2, "turn": 3}}, {"/limits/speed": 2}, ["/limits/speed"]),
        ({"/limits/speed": 1}, {"/limits/speed": 2}, {"/limits/speed": 2}, ["/limits/speed"]),
    ],
)  # fmt: skip
def test_what_is_set(given: dict[str, Any], found: dict[str, Any], values: dict[str, Any], kept: list[str]) -> None:
    before = copy.deepcopy(given)
    merged = merge(given, found, "/arm")
    assert (merged.values, merged.kept, merged.refused, given) == (values, kept, {}, before)


@pytest.mark.parametrize(
    ("given", "found", "refused"),
    [
        ({"/arm/pid": PID}, {"/arm/pid": 3}, "/arm/pid was a number, and params say a mapping"),
        ({"/arm/pid": 3}, {"/arm/pid": PID}, "/arm/pid was a mapping, and params say a number"),
        ({"/arm/pid/p": 3}, {"/arm/pid": 2}, "/arm/pid was a number, and params say a mapping"),
        ({"/arm/pid": 3}, {"/arm/pid/p": 2}, "/arm/pid was a mapping, and params say a number"),
        ({"/arm/mode": "fast"}, {"/arm/mode": 2}, "/arm/mode was a number, and params say a text"),
        ({"/arm/on": True}, {"/arm/on": 1}, "/arm/on was a number, and params say true or false"),
        ({"/arm/gains": [1]}, {"/arm/gains": "1"}, "/arm/gains was a text, and params say a list"),
    ],
)
def test_a_value_of_another_kind_is_not_kept(given: dict[str, Any], found: dict[str, Any], refused: str) -> None:
    merged = merge(given, found, "/arm")
    assert (merged.values, merged.kept, list(merged.refused.values())) == (given, [], [refused])
    assert not any(merged.takes(name) for name in (*given, *found, "/arm"))
    assert merged.takes("/arm/pi")
