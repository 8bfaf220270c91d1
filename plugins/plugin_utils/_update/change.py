# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""A guarded change: what is done to a host, in what world, and how patiently."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from ansible_collections.rosops.fleet.plugins.plugin_utils._update.world import Clock, Cluster, Host, unheard


class Change(Protocol):
    """What is to be done to the host. Every method does what it says or raises one of our errors."""

    @property
    def name(self) -> str: ...

    @property
    def before(self) -> str:
        """What an operator reads of what is there."""

    @property
    def after(self) -> str:
        """Of what is to come; the same as `before` where only settings change."""

    @property
    def unproven(self) -> bool:
        """Whether what is there was made by a run that ended before it was proven."""

    @property
    def left(self) -> str:
        """What a run leaves that can neither prove it nor go back."""

    def make(self) -> None:
        """Do it. After an error some of it may be done."""

    def works(self) -> None:
        """Wait until what was changed serves by its own word; NotReadyError."""

    def undo(self) -> None:
        """The way back, whatever part of the change was made."""

    def proven(self) -> None:
        """What is there now has been proven, and is what a later change goes back to."""


class NodeCluster(Cluster, Protocol):
    """The cluster as a change of one of its nodes needs it."""

    def beat(self, node: str) -> str:
        """When the node's kubelet was last heard of, in its own words; empty where it never was."""


@dataclass(frozen=True)
class Limits:
    """How patient a change is, in seconds; `on_busy` is wait, defer or force."""

    on_busy: str = "wait"
    busy_timeout: float = 600.0
    ready_timeout: float = 300.0
    look: float | None = None  # of waiting in this run, which then is over and may come back. None: all of it
    since: float | None = None  # when an earlier run began to wait, by the clock's `now`
    stable: float = 1.0
    check: bool = False


@dataclass(frozen=True)
class Surroundings:
    """What the change is made in; without a `cluster` nobody can be asked who works here."""

    host: Host
    clock: Clock
    cluster: NodeCluster | None = None
    say: Callable[[str], None] = unheard
    trace: Callable[[str], None] = unheard
