# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the fleet's clusters hold, asked side by side: one that does not answer keeps nobody from the others."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import ExitStack
from dataclasses import dataclass, field

from ...module_utils._common.errors import FleetError, KubeError
from ...module_utils._step.objects import Object
from .._kube.client import Kube
from .._model import names
from .._update.outcome import EVENTS_NAME
from .host_run import HostRun
from .kept import REF, kept_runs, kept_steps

SECONDS = 60.0
MOST_AT_ONCE = 16
# Kind and label selector. Nothing is asked for that is not shown.
KINDS = {
    "Node": "",
    "Deployment": f"app.kubernetes.io/managed-by={names.MANAGER}",
    "Pod": names.LABEL_APP,
    "PersistentVolumeClaim": "",
    "Service": "",
    "StorageClass": "",
}


@dataclass
class Answer:
    """The objects of a cluster by kind, why there are no more of them (empty: these are all), and the last runs that it
    keeps."""

    objects: dict[str, list[Object]] = field(default_factory=dict)
    problem: str = ""
    runs: list[HostRun] = field(default_factory=list)


def ask(opened: Mapping[str, Callable[[], Kube]], seconds: float = SECONDS) -> dict[str, Answer]:
    """The answer of each cluster, by its name; `opened` connects to it, or raises one of our errors."""
    answers: dict[str, Answer] = {}
    pool = ThreadPoolExecutor(MOST_AT_ONCE)
    # All are opened before any is closed: the client's temporary files of keys go with the first that is closed.
    with ExitStack() as open_ones:
        running = {}
        for cluster, connect in opened.items():
            try:
                kube = open_ones.enter_context(connect())
            except FleetError as error:
                answers[cluster] = Answer(problem=str(error))
            else:
                running[cluster] = pool.submit(_read, kube)
        wait(running.values(), timeout=seconds)
        late = Answer(problem=f"no answer within {seconds:.0f} s")
        answers.update((cluster, one.result() if one.done() else late) for cluster, one in running.items())
        pool.shutdown(wait=False, cancel_futures=True)
    return {cluster: answers[cluster] for cluster in opened}


def _read(kube: Kube) -> Answer:
    answer = Answer()
    try:
        for kind, labels in KINDS.items():
            answer.objects[kind] = kube.objects(kind, labels=labels)
        answer.runs += kept_runs(kube.get(REF))
        answer.runs += kept_steps(kube.objects("ConfigMap", fields=f"metadata.name={EVENTS_NAME}"))
    except KubeError as error:
        answer.problem = str(error)
    return answer
