# SPDX-License-Identifier: GPL-3.0-or-later
"""The words for what became of a robot. The engine says them, reports and the exporter's metrics repeat them."""

from __future__ import annotations

UPDATED, UNCHANGED, FAILED = "updated", "unchanged", "failed"
OFFLINE, BUSY, ROLLED_BACK = "deferred-offline", "deferred-busy", "rolled-back"
OUTCOMES = (UPDATED, UNCHANGED, OFFLINE, BUSY, ROLLED_BACK, FAILED)
