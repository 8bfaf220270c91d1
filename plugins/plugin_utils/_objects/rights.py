# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What an account may do in a cluster: Kubernetes' roles. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from ...module_utils._step.objects import Object
from .common import made

RBAC = "rbac.authorization.k8s.io"
Rule = tuple[str, Sequence[str], Sequence[str]]  # an API group, kinds of it, and what may be done with them


def rights(
    account: Mapping[str, str], rules: Iterable[Rule], namespace: str = "", labels: Mapping[str, str] | None = None
) -> list[Object]:
    """A role of the account's name in a namespace, or without one in the whole cluster, given to the account.

    `account` is `{name, namespace}`.
    """
    kind, name = "Role" if namespace else "ClusterRole", account["name"]
    allowed = [{"apiGroups": [group], "resources": [*kinds], "verbs": [*verbs]} for group, kinds, verbs in rules]
    return [
        made(f"{RBAC}/v1", kind, name, namespace, labels, rules=allowed),
        made(
            f"{RBAC}/v1",
            f"{kind}Binding",
            name,
            namespace,
            labels,
            roleRef={"apiGroup": RBAC, "kind": kind, "name": name},
            subjects=[{"kind": "ServiceAccount", **account}],
        ),
    ]
