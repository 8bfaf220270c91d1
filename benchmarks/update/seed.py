# SPDX-License-Identifier: GPL-3.0-or-later
"""The dissertation's own figures: chapter 4, tables 4.2, 4.3 and 4.4. Means of ten trials, without stress."""

from __future__ import annotations

# Table 4.4, of 100,000 messages at 500 Hz; the downtime is the text's own estimate from the loss.
LOST = {"pubsub/minor": 8, "pubsub/major": 7, "pubsub/simultaneous": 17}
DOWNTIME_MS = {"pubsub/minor": 16, "pubsub/major": 14, "pubsub/simultaneous": 34}
SENT = 100_000

# Table 4.2: 95th percentile of a request's latency.
SERVICE_P95_MS = {"before": 45, "during": 83}
SERVICE_FAILED = 0

# Table 4.3: completion of a goal without and with an update.
ACTION_MS = {"before": 220, "during": 388}
ACTION_ABORTED = 0
