# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which pods are begun anew because a ROS node of theirs hangs. Pure: it is told what was asked and what the API shows.

A node hangs when its process does not answer the slave API's `getPid` for so long, while its address refuses nothing.
A host or a network that is away looks the same from here. So a node counts only while another one of its host answers,
which for a robot's own master is always so: the keeper itself is on that host.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Iterable, Mapping

from .._ros.graph import host_of
from .._step.objects import Object, annotations_of, app_of, has_node, is_ready
from .._step.words import KEEPER, LIVENESS, LIVENESS_TIMEOUT, MASTER

AT_MOST, WITHIN = 3, 3600.0  # restarts of an app, in so many seconds: more of them help nobody
# Times the timeout: after that, goals of a node that cannot be read keep nobody waiting.
UNREADABLE = 5


@dataclass(frozen=True)
class Silence:
    """What became of the last questions: node -> its address and for how many seconds it has not answered."""

    silent: Mapping[str, tuple[str, float]] = field(default_factory=dict)
    answering: frozenset[str] = frozenset()  # addresses (URIs) of nodes that answered


@dataclass(frozen=True)
class Hung:
    """A pod, and its node that is silent longest."""

    pod: Object
    node: str
    seconds: float
    timeout: float

    @property
    def app(self) -> str:
        return app_of(self.pod)


def hung_pods(pods: Iterable[Object], silence: Silence) -> list[Hung]:
    """The longest silent one first."""
    there = list(pods)
    awake = {host_of(uri) for uri in silence.answering}
    hosts = {_status(pod).get("hostIP") for pod in there if _status(pod).get("podIP") in awake or app_of(pod) == KEEPER}
    found = []
    for pod in there:
        timeout = liveness_timeout(pod)
        silent = [(seconds, node) for node, (uri, seconds) in silence.silent.items() if has_node(pod, node, uri)]
        seconds, node = max(silent, default=(0.0, ""))
        if node and 0 < timeout <= seconds and _is_up(pod) and _status(pod).get("hostIP") in hosts:
            found.append(Hung(pod, node, seconds, timeout))
    return sorted(found, key=lambda one: -one.seconds)


def in_no_pod(pods: Iterable[Object], silence: Silence) -> set[str]:
    """Addresses of silent nodes that are no pod's, as a laptop's are."""
    there = list(pods)
    return {
        uri for node, (uri, _seconds) in silence.silent.items() if not any(has_node(pod, node, uri) for pod in there)
    }


def liveness_timeout(pod: Object) -> float:
    """Seconds; 0: never."""
    try:
        return float(annotations_of(pod).get(LIVENESS, LIVENESS_TIMEOUT))
    except ValueError:  # by hand
        return 0.0


def _is_up(pod: Object) -> bool:
    """Whether it is an app's that the API has for ready, so its host is there; and nobody has ended it yet."""
    return is_ready(pod) and app_of(pod) not in ("", MASTER, KEEPER)


def _status(pod: Object) -> Object:
    return pod.get("status") or {}
