# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The words for what became of a robot. The engine says them, reports and the exporter's metrics repeat them."""

from __future__ import annotations

UPDATED, UNCHANGED, FAILED = "updated", "unchanged", "failed"
OFFLINE, BUSY, ROLLED_BACK = "deferred-offline", "deferred-busy", "rolled-back"
OUTCOMES = (UPDATED, UNCHANGED, OFFLINE, BUSY, ROLLED_BACK, FAILED)
