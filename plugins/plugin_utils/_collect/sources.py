# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which claims of which hosts are collected, and into which directory each goes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from ansible_collections.rosops.fleet.plugins.plugin_utils._model.names import claim_name, robot_namespace


class Source(NamedTuple):
    """A claim's directory on a host, and the directory of the control node that it goes to."""

    host: str
    directory: str
    target: str
    files: Mapping[str, Mapping[str, int]]
    passed: Sequence[str]


def sources(listed: Mapping[str, Sequence[Mapping[str, Any]]]) -> list[Source]:
    """`listed` is what each host said of its claims.

    A claim that is there twice, as after a cluster was made anew, is told apart by its volume: nothing of one is ever
    laid over the other.
    """
    claims = [(host, claim) for host in sorted(listed) for claim in listed[host]]
    keys = [(claim["namespace"], claim["claim"]) for _place, claim in claims]
    return [
        Source(host, claim["directory"], _target(claim, keys.count(key) > 1), claim["files"], claim["passed"])
        for (host, claim), key in zip(claims, keys, strict=True)
    ]


def _target(claim: Mapping[str, Any], twice: bool) -> str:
    owner = claim["namespace"].removeprefix(robot_namespace(""))
    volume = claim["claim"].removesuffix(claim_name(""))
    return f"{owner}/{volume}" + (f".{claim['directory'].partition('_')[0]}" if twice else "")


def missing(listed: Mapping[str, Sequence[Mapping[str, Any]]], wanted: Sequence[str]) -> Iterator[str]:
    """The volumes that are asked for, of which no host has a claim."""
    there = {claim["claim"] for claims in listed.values() for claim in claims}
    return (volume for volume in wanted if claim_name(volume) not in there)
