# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which claims of which hosts are collected, and into which directory each goes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from ansible_collections.rosops.fleet.plugins.module_utils._host.claims import Claim, claim_of
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.names import claim_name, robot_namespace


class Source(NamedTuple):
    """A claim's directory on a host, and the directory of the control node that it goes to."""

    host: str
    directory: str
    target: str
    files: Mapping[str, Mapping[str, int]]
    passed: Sequence[str]


class Asked(NamedTuple):
    """What may come: the robots' namespaces that are asked for, and of each robot's host its own namespace alone."""

    namespaces: frozenset[str]
    own: Mapping[str, str]

    def takes(self, host: str, namespace: str) -> bool:
        """Whether a claim of a namespace may lie on a host; one of the edge's has those of all robots."""
        return namespace in self.namespaces and namespace == self.own.get(host, namespace)


def sources(listed: Mapping[str, Sequence[Mapping[str, Any]]], asked: Asked) -> list[Source]:
    """`listed` is what each host said of its claims, and whoever is root there says what he wants.

    So a claim is what its directory's name says, in the one form that Kubernetes gives it, and what is there of a
    namespace that the host does not have is left alone. A claim that is there twice, as after a cluster was made anew,
    is told apart by its volume: nothing of one is ever laid over the other.
    """
    said = [(host, claim, claim_of(str(claim["directory"]))) for host in sorted(listed) for claim in listed[host]]
    claims = [(host, claim, name) for host, claim, name in said if name and asked.takes(host, name.namespace)]
    keys = [(name.namespace, name.claim) for _host, _claim, name in claims]
    return [
        Source(host, name.directory, _target(name, keys.count(key) > 1), claim["files"], claim["passed"])
        for (host, claim, name), key in zip(claims, keys, strict=True)
    ]


def strange(claims: Sequence[Mapping[str, Any]]) -> list[str]:
    """The directories that a host says are claims', and that are not."""
    return [str(claim["directory"]) for claim in claims if not claim_of(str(claim["directory"]))]


def _target(name: Claim, twice: bool) -> str:
    owner = name.namespace.removeprefix(robot_namespace(""))
    volume = name.claim.removesuffix(claim_name(""))
    return f"{owner}/{volume}" + (f".{name.directory.partition('_')[0]}" if twice else "")


def missing(listed: Mapping[str, Sequence[Mapping[str, Any]]], wanted: Sequence[str]) -> Iterator[str]:
    """The volumes that are asked for, of which no host has a claim."""
    there = {claim["claim"] for claims in listed.values() for claim in claims}
    return (volume for volume in wanted if claim_name(volume) not in there)
