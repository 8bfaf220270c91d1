# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The wait between two waves: until what is new has soaked, and keepers have proven it or taken it back."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from ...module_utils._step.objects import app_of
from ...module_utils._step.record import soaks
from ...module_utils._step.update_record import back_in_words, ways_back
from .._model.outcomes import FAILED, ROLLED_BACK, UPDATED
from .outcome import RobotOutcome
from .revisions import read_records
from .world import Clock, Cluster, Live, unheard

LOOK_SECONDS = 5.0
LATE = 60.0  # seconds: a keeper looks at one robot after the other, and each look may take its time


def soak(
    cluster: Cluster,
    namespaces: Sequence[str],
    new: Mapping[str, str],
    clock: Clock,
    trace: Callable[[str], None] = unheard,
) -> RobotOutcome:
    """What became of a robot whose apps were updated; `new` is app -> revision, `trace` hears of what. KubeError."""
    began = clock.now()
    while True:
        live = cluster.read(namespaces)
        records = read_records(live.maps)
        bad = taken_back(live, new)
        if bad:
            return RobotOutcome(ROLLED_BACK, "; ".join(bad))
        soaking = [app_of(item) for item in live.deployments if soaks(item, records) and app_of(item) in new]
        if not soaking:
            return RobotOutcome(UPDATED)
        spent, seconds = clock.now() - began, max(records[app].soak for app in soaking)
        if spent >= 2 * seconds + LATE:
            return RobotOutcome(
                FAILED,
                f"the robot's keeper has said for {spent:.0f} s neither that {', '.join(soaking)} stays good nor that "
                "it does not; see its log (kubectl logs deploy/ros-keeper)",
            )
        trace(f"waits whether {', '.join(soaking)} stays good for {seconds:.0f} s")
        clock.sleep(LOOK_SECONDS)


def taken_back(live: Live, new: Mapping[str, str]) -> list[str]:
    """Of each app that the keeper has taken back from its new revision: that it is so, and why."""
    back = ways_back(live.deployments, read_records(live.maps))
    return [f"{app}: {back_in_words(told)}" for app, told in back.items() if told["from"] == new.get(app)]
