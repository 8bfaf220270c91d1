# SPDX-License-Identifier: GPL-3.0-or-later
"""In which order the rounds come. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

STRESS = {"no": (False,), "yes": (True,), "both": (False, True)}


def rounds(trials: int, arms: Sequence[str], stress: str, cases: Sequence[str]) -> Iterator[tuple[bool, int, str, str]]:
    """(stress, trial, arm, case): the arms of a case one after the other, and none of them always first.

    A run that is cut off has as many trials under stress as without.

    >>> list(rounds(1, ("plain", "fleet"), "no", ("a", "b")))
    [(False, 1, 'plain', 'a'), (False, 1, 'fleet', 'a'), (False, 1, 'fleet', 'b'), (False, 1, 'plain', 'b')]
    """
    for trial in range(1, trials + 1):
        for under_stress in STRESS[stress]:
            for number, case in enumerate(cases):
                for arm in arms if (trial + number) % 2 else reversed(arms):
                    yield under_stress, trial, arm, case
