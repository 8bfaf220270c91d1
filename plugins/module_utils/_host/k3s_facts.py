# SPDX-License-Identifier: GPL-3.0-or-later
"""What k3s is on a host, and what it runs with: all that decides whether something is to be done about it."""

from __future__ import annotations

import os

from .._common.documents import Arguments
from .._common.poll import PASS
from .facts import Facts, cgroup, reach, server_url
from .k3s import BINARY, CONFIG_DIR, DATA_DIR, ETCD, KUBECONFIG, SERVICES, UNIT_DIRECTORY, K3sHost, token_verdict
from .k3s_change import K3sChange

KNOCK = 2.0  # seconds


def k3s_facts(host: K3sHost, asked: Arguments) -> Facts:
    """`asked` are the `role` that the host is to have, the `files` that k3s reads when it starts, `token` and
    `agent_token` as the inventory gives them (empty: keep those that are there), and the `servers` as address:port.

    `stale`: k3s was started with other files. `data`: there is a datastore (server) or a node's certificate (agent); a
    host without it says which servers are `answering`. `cgroup_refused`: k3s 1.35 and newer does not start here.
    `tokens` are verdicts alone, and `change` is the last exchange.
    """
    role, files, servers = asked["role"], asked["files"], asked["servers"]
    service, other = SERVICES[role], SERVICES["agent" if role == "server" else "server"]
    shown = host.show(service)
    # what runs now runs, however often it had to be started before
    seen = host.look(role, restarts_before=int(shown.get("NRestarts") or 0))
    change = K3sChange(host.run, role).record()
    data = host.path(f"{DATA_DIR}/server/db" if role == "server" else f"{DATA_DIR}/agent/client-kubelet.crt").exists()
    knocks = [] if data else reach(servers, KNOCK)
    return {
        "machine": os.uname().machine,
        "version": host.version(),
        "files": {name: host.describe(name) for name in dict.fromkeys([*files, BINARY])},
        "images": host.sizes(f"{DATA_DIR}/agent/images"),
        "service": {
            "active": shown.get("ActiveState", "inactive"),
            "enabled": shown.get("UnitFileState") == "enabled",
            "installed": shown.get("LoadState") == "loaded",
        },
        "other_service": host.path(f"{UNIT_DIRECTORY}/{other}.service").exists(),
        "stale": host.stale(service, files),
        "ready": seen.verdict == PASS,
        "data": data,
        "etcd": role == "server" and host.path(ETCD).exists(),
        "tokens": {
            name: token_verdict(
                asked[option], host.read(f"{CONFIG_DIR}/{file}"), host.read(f"{DATA_DIR}/server/{file}")
            )
            for name, option, file in (("server", "token", "token"), ("agent", "agent_token", "agent-token"))
        },
        "server_url": server_url(host.read(f"{CONFIG_DIR}/config.yaml")),
        "cgroup_refused": cgroup(host)["refused"],
        "answering": [server for server, knock in zip(servers, knocks) if knock["outcome"] == "open"],
        "change": {"unproven": change.unproven, "version": change.version},
        "kubeconfig_sha256": host.describe(KUBECONFIG)["sha256"],
    }
