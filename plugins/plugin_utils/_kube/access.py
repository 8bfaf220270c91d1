# SPDX-License-Identifier: GPL-3.0-or-later
"""Which cluster, with what credentials, and whose it is.

Kubernetes.core's options and K8S_AUTH_* variables are worked out by its own code. `get_api_client` itself is no use
here: it asks the server for its version and its resource types at once, with no limit of time, so that one robot that
is off would hold up the run for minutes. The steps before that are taken from it.

A ConfigMap in kube-system says whose a cluster is, and a run compares it before it believes anything. Two inventories
may well have hosts, robots and clusters of the same names, so only the fleet's own name tells their clusters apart.
"""

from __future__ import annotations

import contextlib
import os
import traceback
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ansible_collections.kubernetes.core.plugins.module_utils.args_common import AUTH_ARG_SPEC

from ...module_utils._common.documents import Arguments, Result
from ...module_utils._common.errors import KubeError
from ...module_utils._step.objects import Object
from .._model import names
from .._model.fleet import UNNAMED
from .._upstream import kubernetes_core
from .cache import Ref

try:
    import urllib3
    from kubernetes.client import Configuration
    from kubernetes.client.rest import RESTClientObject

    IMPORT_ERROR: str = ""
    BROKEN: tuple[type[Exception], ...] = (urllib3.exceptions.HTTPError, OSError)  # what a broken connection raises
except ImportError:
    IMPORT_ERROR, BROKEN = traceback.format_exc(), (OSError,)

# Those of kubernetes.core's options that a task may have. What else there is to say of an access, a kubeconfig has or
# the variables K8S_AUTH_*.
OPTIONS = ("host", "api_key", "kubeconfig", "context", "ca_cert", "validate_certs", "proxy", "no_proxy")
ACCESS_ARGS: Mapping[str, Any] = {name: AUTH_ARG_SPEC[name] for name in OPTIONS}
ANYWHERE = "the task's options, its environment or ~/.kube/config"
IDENTITY = Ref("ConfigMap", names.IDENTITY, "kube-system", "v1")


class NoClusterError(KubeError):
    """There is no kubeconfig where one is looked for: the run that makes the cluster has not been there yet."""


class ServersAwayError(KubeError):
    """No server of the cluster can be reached over SSH, so there is no access to it."""


class WrongClusterError(KubeError):
    """The access leads to a cluster that is not the inventory's, or to one that cannot be told to be."""


@dataclass(frozen=True)
class Access:
    """The client's configuration and connection pool, headers to send along as (name, value), where they come from."""

    configuration: Any
    pool: Any
    headers: tuple[tuple[str, str], ...]
    source: str


def access_from(params: Arguments, environment: bool = True, source: str = ANYWHERE) -> Access:
    """The access that a task's options describe, and for those not given, if it counts, the process' environment.

    `source` says in messages whence that is. Raises NoClusterError where the kubeconfig is not there, KubeError when
    the library is missing or no credentials can be read.
    """
    if IMPORT_ERROR:
        raise KubeError(
            "The Python library kubernetes is missing where this runs (the control node): install it there.",
            exception=IMPORT_ERROR,
        )
    given = given_options(params)
    with contextlib.nullcontext() if environment else _without_environment():
        auth = kubernetes_core.create_auth_spec(None, **given)
        own_headers = kubernetes_core.create_headers(None, **given)
    path = auth["kubeconfig"] if isinstance(auth.get("kubeconfig"), str) else ""
    if path and not any(Path(one).expanduser().exists() for one in path.split(os.pathsep)):
        raise NoClusterError(
            f"There is no kubeconfig {path} on the control node. Without one that is given, a run fetches its access "
            "from the cluster's own server."
        )
    try:
        configuration = kubernetes_core.create_configuration(auth)
    except Exception as exc:  # the client's loader lets through what YAML, files and plugins raise
        why = " ".join(str(exc).split())
        raise KubeError(
            f"No usable Kubernetes credentials in {path or 'kubeconfig'}: {why}. Set kubeconfig (or "
            "K8S_AUTH_KUBECONFIG) to the cluster's kubeconfig, or host and api_key (K8S_AUTH_HOST, K8S_AUTH_API_KEY)."
        ) from exc
    finally:
        # The loader keeps what it read as the process' default; a second cluster must not inherit the first one's.
        Configuration.set_default(None)
    headers = [
        (name, value)
        for name, values in own_headers.items()
        for value in (values if isinstance(values, list) else [values])
    ]
    return Access(configuration, RESTClientObject(configuration).pool_manager, tuple(headers), source)


def given_options(params: Arguments) -> Result:
    """The access's options that are given. An empty one is not: "{{ path | default('') }}" must hide nothing."""
    return {key: params[key] for key in ACCESS_ARGS if params.get(key) not in (None, "", {}, [])}


@contextlib.contextmanager
def _without_environment() -> Iterator[None]:
    """kubernetes.core fills up every option from K8S_AUTH_*, also beside a kubeconfig that is given."""
    hidden = {name: os.environ.pop(name) for name in list(os.environ) if name.startswith("K8S_AUTH_")}
    try:
        yield
    finally:
        os.environ.update(hidden)


# --- whose it is ------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Identity:
    """The fleet's name (`fleet_name`) and the cluster's within it."""

    fleet: str
    cluster: str

    def __str__(self) -> str:
        return f"the cluster {self.cluster} of the fleet {self.fleet}"

    def as_object(self) -> Object:
        """The ConfigMap that says it."""
        ref, labels, data = IDENTITY, {"app.kubernetes.io/managed-by": names.MANAGER}, asdict(self)
        metadata = {"name": ref.name, "namespace": ref.namespace, "labels": labels}
        return {"apiVersion": ref.api_version, "kind": ref.kind, "metadata": metadata, "data": data}


def identity_in(found: Object | None) -> Identity | None:
    """What a cluster's ConfigMap says; nothing where it has none."""
    data = (found or {}).get("data") or {}
    return Identity(str(data.get("fleet")), str(data.get("cluster"))) if {"fleet", "cluster"} <= set(data) else None


def to_be_adopted(found: Identity | None, wanted: Identity, own: bool, where: str) -> bool:
    """Whether the cluster is ours and does not say so yet; WrongClusterError where it is not known to be ours.

    `own`: the access was fetched from the cluster's own server. That proves a cluster which has no identity yet, or
    that of a fleet without a name, to be the inventory's; it does not prove that a host was not given to another fleet.
    `where` names the API and whence the access to it is.
    """
    if found == wanted:
        return False
    if own and found in (None, Identity(UNNAMED, wanted.cluster)):
        return True
    if found is None:
        raise WrongClusterError(
            f"{where} leads to a cluster that carries no fleet's identity; the inventory's is {wanted}. Nothing was "
            "read or changed. If it is that one, run the stage node of rosops.fleet.site once without this access: the "
            "run then fetches its access from the cluster's own server, and writes the identity."
        )
    raise WrongClusterError(
        f"{where} leads to {found}; the inventory's is {wanted}. Nothing was read or changed. "
        + (
            f"If hosts or names have changed on purpose, delete the {IDENTITY} there (k3s kubectl on the server), and "
            "run rosops.fleet.site."
            if own
            else "Take that access away, or use the other inventory."
        )
    )
