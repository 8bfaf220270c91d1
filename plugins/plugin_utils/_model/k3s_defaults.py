# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What k3s and its kubelet do by themselves where nobody says otherwise, as of v1.34."""

from __future__ import annotations

# k3s's own eviction-hard: with less of the disk free the Node has DiskPressure, and the kubelet evicts pods.
EVICTION_FREE_PERCENT = 5
# The kubelet's imageGCHighThresholdPercent: with more of the disk used it deletes images that no container uses, those
# that were never used first.
IMAGE_GC_USED_PERCENT = 85
# From this minor version on the kubelet ends on a host with cgroup v1, unless failCgroupV1 is false.
CGROUP_V2_FROM = (1, 35)
