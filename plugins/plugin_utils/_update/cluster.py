# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The robot's cluster, asked in the process of the action: one connection for a whole update."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import Callable, Iterable, Sequence

from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.applied import Applied
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.cache import parse_refs
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.client import Kube, ref_of
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.wait import Settings, wait_for_rollout
from ansible_collections.rosops.fleet.plugins.plugin_utils._model import names
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.world import Live, Object

KINDS = {"Deployment": "apps/v1", "ConfigMap": "v1", "Service": "v1"}


class KubeCluster:
    """`say` gets what is still open, every ten seconds of a wait."""

    def __init__(self, kube: Kube, say: Callable[[str], None]) -> None:
        self._kube, self._say = kube, say

    def read(self, namespaces: Iterable[str]) -> Live:
        """Only what is ours."""
        wanted = [(kind, namespace) for kind in KINDS for namespace in namespaces]
        ours = f"app.kubernetes.io/managed-by={names.MANAGER}"
        with ThreadPoolExecutor(len(wanted)) as pool:
            lists = list(pool.map(lambda one: self._kube.objects(one[0], one[1], ours), wanted))
        found: dict[str, list[Object]] = {kind: [] for kind in KINDS}
        for (kind, _namespace), items in zip(wanted, lists, strict=True):
            # the items of a list do not say what they are
            found[kind] += [{**item, "apiVersion": KINDS[kind], "kind": kind} for item in items]
        return Live(found["Deployment"], found["ConfigMap"], found["Service"])

    def apply(self, objects: Sequence[Object], dry_run: bool = False) -> Sequence[Applied]:
        return self._kube.apply(objects, dry_run)

    def delete(self, objects: Sequence[Object]) -> None:
        self._kube.delete([ref_of(item) for item in objects])

    def wait(self, objects: Sequence[Object], timeout: float, fail_on_restart: bool = False) -> None:
        refs = parse_refs([dict(item) for item in objects])
        if refs:
            wait_for_rollout(self._kube, refs, Settings(timeout, fail_on_restart=fail_on_restart, say=self._say))
