# SPDX-License-Identifier: GPL-3.0-or-later
"""For the playbook awx_access: an account of a controller's own in the host's cluster, and its kubeconfig in a file.

Nothing of the token is returned.
"""

from __future__ import annotations

import base64
from collections.abc import Mapping
from typing import ClassVar

import yaml

from ..module_utils._common.documents import Arguments, Result, Variables
from ..module_utils._common.errors import KubeError
from ..module_utils._common.poll import PASS, WAIT, Seen, poll
from ..module_utils._step.objects import Object
from ..plugin_utils._action.cluster import ClusterAction, foreseen, written
from ..plugin_utils._kube.client import Kube, ref_of
from ..plugin_utils._kube.kubeconfig import keep, local_kubeconfig
from ..plugin_utils._model.fleet import home_of
from ..plugin_utils._objects.rights import cluster_objects, controller_access

TOKEN_SECONDS = 30.0


class ActionModule(ClusterAction):
    ARGUMENTS: ClassVar = {"dest": {"type": "path", "required": True}}

    def work(self, params: Arguments, known: Variables) -> Result:
        objects, check = [*cluster_objects(), *controller_access()], bool(self._task.check_mode)
        with self.cluster(params, known) as kube:
            result = written(kube.apply(objects, check))
            if check and result["changed"]:
                return result
            data = _token(kube, objects[-1])
            text = kubeconfig(data, kube.host, home_of(known).part.cluster)
        return {**result, "changed": keep(params["dest"], text, check) or result["changed"], "dest": params["dest"]}

    def foresee(self, _params: Arguments, _known: Variables) -> Result:
        return foreseen([*cluster_objects(), *controller_access()])


def _token(kube: Kube, secret: Object) -> Mapping[str, str]:
    """What the cluster puts into the Secret, in a moment."""

    def look() -> Seen:
        data = (kube.get(ref_of(secret)) or {}).get("data") or {}
        return Seen(PASS if data.get("token") and data.get("ca.crt") else WAIT, data)

    found = poll(look, TOKEN_SECONDS, 0.5)
    if found.timed_out:
        has = ", ".join(sorted(found.last)) or "nothing"
        raise KubeError(f"the cluster put no token into {ref_of(secret)} within {TOKEN_SECONDS:.0f} s; it has {has}")
    data: Mapping[str, str] = found.last
    return data


def kubeconfig(data: Mapping[str, str], server: str, cluster: str) -> str:
    """Of the Secret's data, for use from elsewhere."""
    user = {"token": base64.b64decode(data["token"]).decode()}
    inner = {"clusters": [{"cluster": {"certificate-authority-data": data["ca.crt"]}}], "users": [{"user": user}]}
    made = local_kubeconfig(yaml.safe_dump(inner), server, cluster)
    return made.partition("\n")[2]  # without the line by which a run knows its own: this one is given
