# SPDX-License-Identifier: GPL-3.0-or-later
"""For the role observability: bring a cluster's stack to what the role's variables say, or tell the images it needs.

Everything is built before anything is applied, so whatever is wrong with a dashboard or a setting is found first.
"""

from __future__ import annotations

import secrets
from typing import ClassVar

from ..module_utils._common.documents import Arguments, Result, Variables
from ..module_utils._step.objects import Object, labels_of
from ..plugin_utils._action.cluster import ClusterAction, foreseen, written
from ..plugin_utils._kube.cache import Ref, parse_refs
from ..plugin_utils._kube.client import Kube, ref_of
from ..plugin_utils._kube.wait import WaitOptions, wait_for_rollout
from ..plugin_utils._model.fleet import Fleet
from ..plugin_utils._model.names import MANAGER
from ..plugin_utils._observability import stack
from ..plugin_utils._observability.files import Files, stack_files
from ..plugin_utils._observability.spec import NAMESPACE, Spec, images, runs, spec_of, tls_secrets
from ..plugin_utils._report.held import nodes_off
from ..plugin_utils._upstream.ansible_core import SHOWN


class ActionModule(ClusterAction):
    ARGUMENTS: ClassVar = {"images_only": {"type": "bool", "default": False}}

    def work(self, params: Arguments, known: Variables) -> Result:
        if params["images_only"]:
            spec = spec_of(self.variables(known, "observability"))
            return {"changed": False, "images": images(spec), **SHOWN}
        spec, files = self._given(known)
        check = self._task.check_mode
        with self.cluster(params, known) as kube:
            certificates = {name: kube.get(Ref("Secret", name, NAMESPACE)) for name in tls_secrets(spec).values()}
            spec = {**spec, "tls_versions": stack.tls_versions(spec, certificates)}
            admin = {"password": "", "version": ""}
            if runs(spec)["grafana"]:
                there = kube.get(ref_of(stack.ADMIN_SECRET))
                fresh = secrets.token_hex(20)
                admin = stack.grafana_admin(there, spec["grafana"]["admin_password"], fresh)
            objects = stack.stack_objects(spec, files, admin["version"])
            namespace, *rest = objects
            done = kube.apply([namespace, *stack.stack_secrets(spec, admin), *rest], check)
            left = map(ref_of, stack.leftovers(spec, objects))
            # a Grafana of somebody else's may have the same name
            ours = [ref for ref in left if labels_of(kube.get(ref)).get("app.kubernetes.io/managed-by") == MANAGER]
            done += kube.delete(ours, check)
            if not check:  # it made nothing that could be waited for
                self._wait(kube, objects, WaitOptions(spec["ready_timeout"], say=self.say(known)))
        return written(done)

    def foresee(self, _params: Arguments, known: Variables) -> Result:
        spec, files = self._given(known)
        return foreseen(stack.stack_objects(spec, files))

    def _given(self, known: Variables) -> tuple[Spec, Files]:
        fleet, host = Fleet.from_vars(known), known["inventory_hostname"]
        robot = host if host in fleet.robots else ""
        variables = self.variables(known, "observability")
        spec = spec_of(variables, robot, () if robot else fleet.edge_nodes)
        base = str(known.get("inventory_dir") or "")
        return spec, stack_files(spec["dashboards"], base, spec["grafana"]["default_dashboards"])

    def _wait(self, kube: Kube, objects: list[Object], options: WaitOptions) -> None:
        off = nodes_off(kube.objects("Node"))
        if off:
            options.say(
                f"{', '.join(off)}: off; what runs on every host starts there when they are back, without a wait"
            )
        # a DaemonSet cannot be rolled out while a host of the cluster is off: that is no fault of the stack
        kinds = ("Deployment", "PersistentVolumeClaim", *(() if off else ("DaemonSet",)))
        wait_for_rollout(kube, parse_refs([one for one in objects if one["kind"] in kinds]), options)
