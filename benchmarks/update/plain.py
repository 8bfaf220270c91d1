# SPDX-License-Identifier: GPL-3.0-or-later
"""The plain arm: `kubectl apply`, and Kubernetes' own rolling update."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Any

from . import plain_manifests as manifests
from .cluster import ROBOT, Cluster, wait_for
from .errors import BenchError
from .rollouts import unfinished
from .scenario import Case
from .step import Step
from .windows import Span

DEPLOY_SECONDS, UPDATE_SECONDS = 240, 120


class PlainArm:
    """Applies manifests and waits, as `kubectl rollout status` does, and for the old pod to be gone."""

    name = "plain"
    namespace = manifests.NAMESPACE

    def __init__(self, cluster: Cluster, names: str, directory: Path, master: dict[str, Any]) -> None:
        self._cluster = cluster
        self._names = names
        self._log = directory / "plain.log"
        self._master = master

    def deploy(self, case: Case) -> None:
        """Its apps at their first version, up."""
        base = manifests.base(ROBOT, self._master)
        self._apply(base)
        self._wait([manifests.MASTER], DEPLOY_SECONDS)
        self._apply([manifests.app_deployment(app, ROBOT, self._names) for app in case.apps])
        self._wait([app.name for app in case.apps], DEPLOY_SECONDS)

    def update(self, case: Case) -> Step:
        """One `kubectl apply` of what the case changes."""
        apps = case.changed()
        objects = [manifests.app_deployment(app, ROBOT, self._names) for app in apps]
        started = time.time()
        self._apply(objects)
        applied = time.time()
        try:
            ended = self._wait([app.name for app in apps], UPDATE_SECONDS)
        except BenchError as error:
            span = Span(started, time.time())
            return Step(span, span, None, outcome="failed", problem=str(error))
        phases = {"apply": applied - started, "rollout": ended - applied}
        span = Span(started, ended)
        return Step(span, span, span.seconds, busy_wait=0.0, phases=phases)

    def _apply(self, objects: list[manifests.Object]) -> None:
        said = self._cluster.kubectl("apply -f -", json.dumps(manifests.as_list(objects)).encode())
        with self._log.open("a", encoding="utf-8") as file:
            file.write(said)

    def _wait(self, names: list[str], seconds: float) -> float:
        def check() -> str:
            # Deployments before pods: a pod that the answer on Deployments knows of is then in the other one, too
            deployments = self._cluster.deployments(self.namespace)
            return unfinished(deployments, self._cluster.pods(self.namespace), names)

        return wait_for(f"{self.name}: rollout of {', '.join(names)}", check, seconds)
