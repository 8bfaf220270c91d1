# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The labels of a pod's log lines, from its files' path and its host's name alone.

No API is asked: a robot whose link is down starts pods after a reboot, too, and their lines carry the right labels from
the first one on. What is read from names is what the collection's own objects say in their labels: a robot's pods are
in `robot-<name>`, and an app's Deployment has the app's name. Pure.
"""

from __future__ import annotations

STREAM_LABELS = ("robot", "namespace", "app", "pod", "placement")
POD_LOGS = "/var/log/pods"

# Letters of generated names: no vowels and nothing that looks like another (k8s.io/apimachinery, util/rand).
_GENERATED = "[bcdfghjklmnpqrstvwxz2456789]"
# The owner's name: a Deployment's pod ends in -<replica set>-<5>, a DaemonSet's in -<5>, a StatefulSet's in -<number>.
APP_OF_POD = rf"(?P<app>.+?)(?:-{_GENERATED}{{5,10}}-{_GENERATED}{{5}}|-{_GENERATED}{{5}}|-[0-9]+)?"
ROBOT_OF_NAMESPACE = r"robot-(?P<robot>.+)"
# /var/log/pods/<namespace>_<pod>_<uid>/<container>/<restarts>.log
PATH = rf"{POD_LOGS}/(?P<namespace>[^_/]+)_(?P<pod>[^_/]+)_[^/]+/(?P<container>[^/]+)/.*"


def anchored(regex: str) -> str:
    """Anchored at both ends, and without a dollar, which the collector's own file takes for a variable's beginning."""
    return rf"\A{regex}\z"
