# SPDX-License-Identifier: GPL-3.0-or-later
"""For the playbook awx_access: an account of a controller's own in the host's cluster, and its kubeconfig in a file.

Nothing of the token is returned, but when it ends.
"""

from __future__ import annotations

import base64
import json
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar

import yaml

from ..module_utils._common.documents import Arguments, Result, Variables
from ..module_utils._step.objects import Object
from ..plugin_utils._action.cluster import ClusterAction, foreseen, written
from ..plugin_utils._kube.cache import Ref
from ..plugin_utils._kube.client import Kube
from ..plugin_utils._kube.kubeconfig import keep, local_kubeconfig
from ..plugin_utils._model.fleet import Fleet, home_of
from ..plugin_utils._objects.namespace import namespace_objects
from ..plugin_utils._objects.rights import CONTROLLER, HOME, cluster_objects, controller_access

ACCOUNT = Ref("ServiceAccount", CONTROLLER, HOME, "v1")
ENDLESS = Ref("Secret", CONTROLLER, HOME, "v1")  # of earlier collections: a token without an end
AUTHORITY = Ref("ConfigMap", "kube-root-ca.crt", HOME, "v1")


class ActionModule(ClusterAction):
    ARGUMENTS: ClassVar = {"dest": {"type": "path", "required": True}, "days": {"type": "int", "default": 90}}

    def work(self, params: Arguments, known: Variables) -> Result:
        check, dest = bool(self._task.check_mode), str(params["dest"])
        with self.cluster(params, known) as kube:
            done = [*kube.apply(_objects(known), check), *kube.delete([ENDLESS], check)]
            token = _lasting(dest, (kube.get(ACCOUNT) or {"metadata": {}})["metadata"].get("uid"))
            if check and not token:
                return {**written(done), "changed": True}
            token = token or kube.token(ACCOUNT, params["days"] * 86400)
            text = _kubeconfig(kube, token, home_of(known).part.cluster)
        result, ends = written(done), time.strftime("%Y-%m-%d", time.gmtime(_claims(token)["exp"]))
        return {**result, "changed": keep(dest, text, check) or result["changed"], "dest": dest, "ends": ends}

    def foresee(self, _params: Arguments, known: Variables) -> Result:
        return foreseen(_objects(known))


def _objects(known: Variables) -> list[Object]:
    """What is the cluster's, its robots' namespaces, and the account with its rights there."""
    fleet, cluster = Fleet.from_vars(known), home_of(known).part.cluster
    robots = [robot for name, robot in fleet.robots.items() if fleet.hosts[name].cluster == cluster]
    made = [one for robot in robots for one in namespace_objects(robot) if one["kind"] == "Namespace"]
    spaces = {str(one["metadata"]["name"]): one for one in made}
    return [*cluster_objects(), *spaces.values(), *controller_access(spaces)]


def _lasting(path: str, account: object) -> str:
    """The token that the file has, if it is of this very account and has a third of its time; else nothing."""
    try:
        token = str(yaml.safe_load(Path(path).expanduser().read_text("utf-8"))["users"][0]["user"]["token"])
        said = _claims(token)
        left, lasts = said["exp"] - time.time(), said["exp"] - said["iat"]
        ours = said["kubernetes.io"]["serviceaccount"]["uid"] == account
    except (OSError, ValueError, TypeError, LookupError, yaml.YAMLError):
        return ""
    return token if ours and left > lasts / 3 else ""


def _claims(token: str) -> Mapping[str, Any]:
    """What a token says of itself (RFC 7519). Nothing rests on it: the API server alone believes tokens."""
    part = token.split(".")[1]
    return dict(json.loads(base64.urlsafe_b64decode(part + "=" * (-len(part) % 4))))


def _kubeconfig(kube: Kube, token: str, cluster: str) -> str:
    """For use from elsewhere. The cluster's authority is in every namespace, for pods."""
    authority = ((kube.get(AUTHORITY) or {}).get("data") or {}).get("ca.crt", "")
    inner = {"certificate-authority-data": base64.b64encode(authority.encode()).decode()}
    said = {"clusters": [{"cluster": inner}], "users": [{"user": {"token": token}}]}
    made = local_kubeconfig(yaml.safe_dump(said), kube.host, cluster)
    return made.partition("\n")[2]  # without the line by which a run knows its own: this one is given
