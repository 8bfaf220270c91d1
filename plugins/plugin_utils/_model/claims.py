# SPDX-License-Identifier: GPL-3.0-or-later
"""Which claims of which hosts are collected, and below which directory each goes.

The storage class local-path keeps a claim in a directory <volume of Kubernetes>_<namespace>_<claim>.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from typing import NamedTuple

from .names import claim_name, robot_namespace

_LABEL = "[a-z0-9](?:[-a-z0-9]{0,61}[a-z0-9])?"  # RFC 1123, as Kubernetes names namespaces
_DIRECTORY = re.compile(rf"(?P<pv>pvc-{_LABEL})_(?P<namespace>{_LABEL})_(?P<claim>{_LABEL})")


class ClaimSource(NamedTuple):
    """A claim's directory on a host, the volume, and the directory of the control node that it goes to."""

    host: str
    directory: str
    volume: str
    target: str


def sources(
    directories: Mapping[str, Collection[str]],
    namespaces: Collection[str],
    own: Mapping[str, str],
    volumes: Collection[str] = (),
) -> list[ClaimSource]:
    """The claims of these `namespaces` and `volumes`, or of all volumes; what a robot's host has of its `own` alone.

    One of the edge's hosts has those of all robots. `directories` are those that each host names, and whoever is root
    there names what he wants.

    So a claim is what its directory's name says, in the one form that Kubernetes gives it. What has no such name, or is
    of a namespace that the host does not have, is left alone. A claim that is there twice, as after a cluster was made
    anew, is told apart by its volume of Kubernetes: nothing of one is ever laid over the other.
    """
    named = [(host, _DIRECTORY.fullmatch(one)) for host in sorted(directories) for one in sorted({*directories[host]})]
    claims = [(host, name, name["claim"].removesuffix(claim_name(""))) for host, name in named if name]
    taken = [
        (host, name, volume)
        for host, name, volume in claims
        if name["namespace"] in namespaces
        and name["namespace"] == own.get(host, name["namespace"])
        and (not volumes or volume in volumes)
    ]
    targets = [f"{name['namespace'].removeprefix(robot_namespace(''))}/{volume}" for _host, name, volume in taken]
    return [
        ClaimSource(host, name[0], volume, f"{target}.{name['pv']}" if targets.count(target) > 1 else target)
        for (host, name, volume), target in zip(taken, targets, strict=True)
    ]
