# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""How a run of the engine goes."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

from .._kube.running import Known
from .._objects.parts import PARTS, READY
from .outcome import StepResult
from .plan import Request


@dataclass(frozen=True)
class Settings:
    """How a run goes. Times are in seconds."""

    request: Request = field(default_factory=Request)
    on_busy: str = "wait"  # wait, defer or force
    busy_timeout: float = 600.0
    look_timeout: float | None = None  # of waiting in this run of the engine; then it is `waiting`. None: as above
    since: Mapping[str, float] = field(default_factory=dict)  # step -> when it began to wait, by the clock's `now`
    earlier: Sequence[StepResult] = ()  # steps that have ended before, in this run of the playbook
    ready_timeout: float = 120.0
    verify_seconds: float = 1.0
    soak: float = 120.0  # for which a version that was found good soaks, before it is proven
    rate_tolerance: float = 0.1
    rate_seconds: float = 1.0
    check: bool = False
    code: Mapping[str, str] = field(default_factory=dict)  # what runs in the pods, file name -> content
    parts: Collection[str] = tuple(part for part in PARTS if part != READY)
    pull_secrets: Sequence[Mapping[str, object]] = ()  # items of robot_namespace_pull_secrets
    remove_claims: Sequence[str] = ()  # names of volumes whose claims go, with their data
    remove_confirm: bool = False
    rollout_timeout: float = 300.0  # of what is installed, whose images may have to be pulled
    at_work: bool = True  # whether a robot at work may be changed; else it is only looked at
    known: Known = lambda _node, _ref: ()
    edge_images: Mapping[str, Sequence[str]] = field(default_factory=dict)  # edge host -> names of images there
