# SPDX-License-Identifier: GPL-3.0-or-later
"""The shipped keeper beside steps (`_robot/step_watch.py`) in the simulated world: its API, its robot, its disk."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any, cast

from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import KubeError
from ansible_collections.rosops.fleet.plugins.module_utils._robot import step_watch
from ansible_collections.rosops.fleet.plugins.module_utils._robot.cluster_api import Cluster, lease_time
from ansible_collections.rosops.fleet.plugins.module_utils._robot.memory import KeptFiles, Silence
from ansible_collections.rosops.fleet.plugins.module_utils._ros.names import is_meant
from ansible_collections.rosops.fleet.plugins.module_utils._step.words import BACK_TO, HISTORY, SOAKING, UPDATING
from ansible_collections.rosops.fleet.plugins.plugin_utils._model import names
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.admission import back_to
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.world import Object
from ansible_collections.rosops.fleet.tests.unit.simulated.robot import FOREVER, Hold, kubernetes_hash, pod_object

if TYPE_CHECKING:
    from ansible_collections.rosops.fleet.tests.unit.simulated.world import Simulation


def refused(there: Object, wanted: Object) -> set[str]:
    """Which facts of what a keeper applies the API server's policy does not know; that nobody marked what is there."""
    notes = there["metadata"]["annotations"]
    if not {UPDATING, SOAKING} & {*notes}:
        return {"no mark"}
    new, old = ({*back_to(one)[BACK_TO].split("\n")} for one in (wanted, there))
    return new - old - {*notes[BACK_TO].split("\n")} if BACK_TO in notes else set()


class SimulatedKeeper:
    """Looks on as long as something is marked, or was. A keeper that was started anew knows what lies on its disk."""

    def __init__(self, sim: Simulation) -> None:
        self.sim = sim
        self.disk: dict[str, Any] = {}
        self.looking, self.process = False, (-1, 0)
        self.said: list[str] = []
        self.generations: dict[tuple[str, str], tuple[str, int]] = {}
        self.watch = self._begin()

    def _begin(self) -> step_watch.StepWatch:
        robot = step_watch.Robot(self.hold, self.release, self.take_back, Silence, lambda *_: None)
        cluster, files, sim = cast("Cluster", self), cast("KeptFiles", self), self.sim
        return step_watch.StepWatch(cluster, sim, robot, files, self.said.append, sim.now, sleep=lambda _seconds: None)

    def begin(self) -> None:
        """Something was marked."""
        if not self.looking:
            self.looking = True
            self.sim.later(step_watch.LOOK, self.look)

    def look(self) -> None:
        pods = [pod for pod in self.sim.pods if pod.app == names.KEEPER_NAME and pod.ready and pod.up]
        if pods:
            process = (pods[-1].uid, pods[-1].restarts)
            if self.process != process:
                self.process, self.watch = process, self._begin()
            self.watch.look()
        self.looking = bool(self._marked() or not (pods and self.watch.rests()))
        if self.looking:
            self.sim.later(step_watch.LOOK, self.look)

    def _marked(self) -> list[Object]:
        return [item for item in self._deployments() if {UPDATING, SOAKING} & {*item["metadata"]["annotations"]}]

    def _deployments(self) -> list[dict[str, Any]]:
        return [item for key, item in self.sim.objects.items() if key[0] == "Deployment"]

    # --- its disk ---------------------------------------------------------------------------------------------------

    def load(self, part: str) -> Any:
        return self.disk.get(part)

    def save(self, part: str, content: Any) -> bool:
        self.disk[part] = json.loads(json.dumps(content))
        return True

    # --- the API ----------------------------------------------------------------------------------------------------

    @property
    def home(self) -> str:
        """The namespace of the master that it keeps."""
        there = (item["metadata"] for item in self._deployments())
        return next((str(one["namespace"]) for one in there if one["name"] == names.MASTER_NAME), "")

    def _ask(self) -> None:
        if max(self.sim.api_until, self.sim.robot_until) > self.sim.time:
            raise KubeError("the API does not answer")

    def stamp(self) -> str:
        return lease_time(self.sim.wall())

    def namespaces(self) -> list[str]:
        self._ask()
        return sorted({item["metadata"]["namespace"] for item in self._deployments()})

    def leases(self) -> dict[str, dict[str, Any]]:
        return {name: self.lease(name) for name in self.namespaces()}

    def lease(self, _namespace: str) -> dict[str, Any]:
        """The runs' one Lease, whichever namespace they claim."""
        self._ask()
        sim = self.sim
        at_work = sim.holder not in ("", names.KEEPER_NAME)
        version = f"{sim.claims} {min(sim.time, sim.renewed):.1f}" if at_work else str(sim.claims)
        return {"metadata": {"resourceVersion": version}, "spec": {"holderIdentity": sim.holder}}

    def write_lease(self, namespace: str, body: Mapping[str, Any]) -> dict[str, Any] | None:
        if self.lease(namespace)["metadata"]["resourceVersion"] != body["metadata"].get("resourceVersion"):
            return None
        self.sim.holder, self.sim.renewed = body["spec"]["holderIdentity"], FOREVER
        self.sim.claims += 1
        return self.lease(namespace)

    def deployments(self, namespace: str) -> list[dict[str, Any]]:
        self._ask()
        return [self._shown(item) for item in self._deployments() if item["metadata"]["namespace"] == namespace]

    def deployment(self, namespace: str, name: str) -> dict[str, Any] | None:
        return next((item for item in self.deployments(namespace) if item["metadata"]["name"] == name), None)

    def _shown(self, item: dict[str, Any]) -> dict[str, Any]:
        """With what the controller says of it."""
        key = (item["metadata"]["namespace"], item["metadata"]["name"])
        template, generation = self.generations.get(key, ("", 0))
        if template != kubernetes_hash(item):
            generation += 1
            self.generations[key] = kubernetes_hash(item), generation
        pods = self.sim.of(key)
        new = [pod for pod in pods if pod.hash == kubernetes_hash(item)]
        status = {
            "observedGeneration": generation,
            "replicas": len(pods),
            "updatedReplicas": len(new),
            "readyReplicas": sum(pod.ready for pod in pods),
        }
        return {**item, "metadata": {**item["metadata"], "generation": generation}, "status": status}

    def pods(self, namespace: str) -> list[dict[str, Any]]:
        self._ask()
        return [pod_object(pod) for pod in self.sim.pods if not pod.gone and pod.key[0] == namespace]

    def config_map(self, namespace: str, name: str) -> dict[str, Any] | None:
        self._ask()
        return self.sim.objects.get(("ConfigMap", namespace, name))

    def apply(self, _namespace: str, body: dict[str, Any]) -> None:
        self._ask()
        key = (body["kind"], body["metadata"]["namespace"], body["metadata"]["name"])
        if body["kind"] == "Deployment":
            assert self.sim.holder == names.KEEPER_NAME, f"the keeper takes {key} back without the Lease"
            assert key in self.sim.objects, f"the keeper makes {key}"
            assert refused(self.sim.objects[key], body) == set(), f"the policy does not let the keeper take {key} back"
        else:
            there = self.sim.objects[key]["data"]
            assert body["data"].get(HISTORY) == there.get(HISTORY), f"the keeper writes the history of {key}"
        self.sim.write(body)

    def unmark(self, _namespace: str, item: Object, key: str) -> None:
        self._ask()
        assert self.sim.holder == names.KEEPER_NAME, f"the keeper proves {item['metadata']['name']} without the Lease"
        there = self.sim.objects["Deployment", item["metadata"]["namespace"], item["metadata"]["name"]]
        notes = {name: text for name, text in there["metadata"]["annotations"].items() if name not in (key, BACK_TO)}
        self.sim.write(there, {**there, "metadata": {**there["metadata"], "annotations": notes}})

    # --- its robot --------------------------------------------------------------------------------------------------

    def hold(self, action: str, server: str, seconds: float) -> list[Any]:
        sim = self.sim
        sim.holds[action] = Hold(sim.registered.get(server), sim.time + seconds)
        sim.later(seconds, lambda: sim.expire(action))
        return [1, "", 0]

    def release(self, action: str) -> list[Any]:
        self.sim.let_go(action)
        return [1, "", 0]

    def take_back(self, nodes: Iterable[str]) -> None:
        self.sim.ask_master()
        wanted = {*nodes}
        for process in self.sim.living():
            if is_meant(process.node, wanted) and not self.sim.registered_whole(process):
                self.sim.register(process)
