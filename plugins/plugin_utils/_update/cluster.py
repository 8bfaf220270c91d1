# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The robot's cluster, asked in the process of the action: one connection for a whole update."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor

from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import KubeError
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.applied import Applied
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.cache import parse_refs
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.client import Kube, ref_of
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.lease import Lease
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.wait import Settings, wait_for_rollout
from ansible_collections.rosops.fleet.plugins.plugin_utils._model import names
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.world import HeldError, Live, Object

LEASE = "robot-update"
LEASE_SECONDS = 15  # so long a robot waits after a run that was killed
RENEW_SECONDS = 5.0
LOOK_SECONDS = 0.5
KINDS = {"Deployment": "apps/v1", "ConfigMap": "v1", "Service": "v1"}


class KubeCluster:
    """`say` gets what is still open, every ten seconds of a wait; `holder` names the run to others."""

    def __init__(self, kube: Kube, say: Callable[[str], None], holder: str) -> None:
        self._kube, self._say, self._holder = kube, say, holder

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

    @contextlib.contextmanager
    def claim(self, namespace: str) -> Iterator[None]:
        lease = Lease(self._kube, namespace, LEASE, self._holder, LEASE_SECONDS)
        self._take(lease)
        over = threading.Event()
        keeper = threading.Thread(target=_renew, args=(lease, over), daemon=True)
        keeper.start()
        try:
            yield
        finally:
            over.set()
            keeper.join()
            with contextlib.suppress(KubeError):  # then it ends by itself
                lease.release()

    def _take(self, lease: Lease) -> None:
        """A holder that lives renews its Lease; one that was killed does not, and its time runs out."""
        hold = lease.acquire()
        if not hold.mine:
            self._say(f"waits whether the run of {hold.holder}, which began {hold.since}, still lives")
        first = hold.renewed
        while not hold.mine:
            if hold.renewed != first:
                raise HeldError(f"{hold.holder} changes this robot since {hold.since}; let that run end")
            time.sleep(LOOK_SECONDS)
            hold = lease.acquire()

    def apply(self, objects: Sequence[Object], dry_run: bool = False) -> Sequence[Applied]:
        return self._kube.apply(objects, dry_run)

    def delete(self, objects: Sequence[Object]) -> None:
        self._kube.delete([ref_of(item) for item in objects])

    def wait(self, objects: Sequence[Object], timeout: float, fail_on_restart: bool = False) -> None:
        refs = parse_refs([dict(item) for item in objects])
        if refs:
            wait_for_rollout(self._kube, refs, Settings(timeout, fail_on_restart=fail_on_restart, say=self._say))


def _renew(lease: Lease, over: threading.Event) -> None:
    while not over.wait(RENEW_SECONDS):
        with contextlib.suppress(KubeError):  # the next time may do
            lease.renew()
