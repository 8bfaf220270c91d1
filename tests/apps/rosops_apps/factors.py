# SPDX-License-Identifier: GPL-3.0-or-later
"""Batches of numbers and their prime factors. No ROS."""

from __future__ import annotations

import math
from typing import Iterable, Iterator, Sequence

FIRST, LAST = 1000, 9999
BATCH = 10


def batch_numbers(batch: int) -> list[int]:
    """The numbers of a batch: ten after ten from 1000 to 9999, then from the start again."""
    first = FIRST + batch * BATCH % (LAST - FIRST + 1)
    return list(range(first, first + BATCH))


def prime_factors(number: int) -> Iterator[int]:
    """The prime factors of a number above 0, the smallest first; each as often as it divides."""
    divisor = 2
    while divisor * divisor <= number:
        while number % divisor == 0:
            yield divisor
            number //= divisor
        divisor += 1 if divisor == 2 else 2
    if number > 1:
        yield number


def is_prime(number: int) -> bool:
    """By trial division, so that the check of an answer does not lean on what it checks."""
    return number > 1 and all(number % divisor for divisor in range(2, math.isqrt(number) + 1))


def count_right(numbers: Sequence[int], answers: Iterable[tuple[int, Sequence[int]]]) -> tuple[int, int]:
    """How many of the answers (number, factors) are right and how many are wrong.

    Wrong is one whose factors are not primes or do not multiply to the number, one that nobody asked for, and one that
    comes a second time.
    """
    open_numbers = set(numbers)
    right = wrong = 0
    for number, factors in answers:
        if number in open_numbers and math.prod(factors) == number and all(map(is_prime, factors)):
            open_numbers.remove(number)
            right += 1
        else:
            wrong += 1
    return right, wrong
