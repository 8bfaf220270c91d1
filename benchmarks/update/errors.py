# SPDX-License-Identifier: GPL-3.0-or-later
"""What ends the benchmark."""

from __future__ import annotations


class BenchError(Exception):
    """The benchmark could not be made; there is no result."""
