# SPDX-License-Identifier: GPL-3.0-or-later
"""In which order the rounds come. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

STRESS = {"no": (False,), "yes": (True,), "both": (False, True)}


def rounds(trials: int, arms: Sequence[str], stress: str) -> Iterator[tuple[bool, int, str]]:
    """(stress, trial, arm): the arms in turn, the other way round in every other trial, so that none is always first.

    A run that is cut off has as many trials under stress as without.

    >>> list(rounds(2, ("plain", "fleet"), "no"))
    [(False, 1, 'plain'), (False, 1, 'fleet'), (False, 2, 'fleet'), (False, 2, 'plain')]
    """
    for trial in range(1, trials + 1):
        for under_stress in STRESS[stress]:
            for arm in arms if trial % 2 else reversed(arms):
                yield under_stress, trial, arm
