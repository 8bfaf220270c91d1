#!/usr/bin/python
# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What k3s is on a host, in one call."""

from __future__ import annotations

DOCUMENTATION = r"""
module: k3s_info
short_description: What k3s is installed on a host and what it runs with
version_added: 1.0.0
description:
  - Reads in one call all that decides whether something must be done about k3s on a host, so that a host on which
    nothing is to be done costs one task.
  - Tokens are compared on the host and never returned.
author:
  - rosops.fleet contributors (@rosops)
options:
  role:
    description: What the host is meant to be.
    type: str
    choices: [server, agent]
    required: true
  files:
    description:
      - Files that k3s reads when it starts. Their digests are returned, and whether the running k3s was started with
        them as they are.
    type: list
    elements: path
    default: []
  token:
    description: The servers' token as the inventory gives it; empty to keep the one there is.
    type: str
    default: ""
  agent_token:
    description: The agents' token as the inventory gives it; empty to keep the one there is.
    type: str
    default: ""
  servers:
    description: C(address:port) of the cluster's servers. A host that has not joined says which of them answer.
    type: list
    elements: str
    default: []
extends_documentation_fragment:
  - rosops.fleet._attributes.read_only
"""

EXAMPLES = r"""
- name: See what is there
  rosops.fleet.k3s_info:
    role: server
    files:
      - /etc/rancher/k3s/config.yaml
      - /usr/local/bin/k3s
  register: k3s
"""

RETURN = r"""
machine:
  description: Hardware name, as C(uname -m) says it.
  returned: success
  type: str
  sample: aarch64
version:
  description: Version of the installed binary; empty if there is none.
  returned: success
  type: str
  sample: v1.34.2+k3s1
files:
  description: Each of O(files) with C(exists), C(sha256), C(size) and C(mode).
  returned: success
  type: dict
images:
  description: The files that k3s imports images from when it starts, each with its size in bytes.
  returned: success
  type: dict
service:
  description: C(active), C(enabled), C(reload) (systemd has not read the unit again), C(installed).
  returned: success
  type: dict
other_service:
  description: Whether the unit of the other role is installed.
  returned: success
  type: bool
stale:
  description: Whether the running k3s was started with other files.
  returned: success
  type: bool
ready:
  description: Whether the unit is up and, on a server, its API ready.
  returned: success
  type: bool
observed:
  description: What RV(ready) rests on.
  returned: success
  type: str
data:
  description: Whether a datastore (server) or a node's certificate (agent) is there.
  returned: success
  type: bool
etcd:
  description: Whether a server's datastore is an embedded etcd.
  returned: success
  type: bool
tokens:
  description:
    - For C(server) and C(agent) each V(absent), V(same), V(restore) (the file is gone, the given token is right),
      V(lost) (the file is gone, none is given) or V(differs).
  returned: success
  type: dict
server_url:
  description: The server that the configuration names; empty where it names none.
  returned: success
  type: str
cgroup_refused:
  description: Whether the host has cgroup v1 and nothing allows it, with which a k3s 1.35 or newer does not start.
  returned: success
  type: bool
answering:
  description: Those of O(servers) to which a connection can be made.
  returned: success
  type: list
  elements: str
change:
  description:
    - Of the last exchange, C(unproven) (nobody has proven it) and C(version) (the one before).
  returned: success
  type: dict
kubeconfig_sha256:
  description: Digest of the administrator's kubeconfig; empty if there is none.
  returned: success
  type: str
"""

import os
from typing import Any, Mapping

from ansible.module_utils.basic import AnsibleModule

from ..module_utils._common.poll import PASS
from ..module_utils._host.facts import Facts, cgroup, reach, server_url
from ..module_utils._host.k3s import BINARY, CONFIG_DIR, DATA_DIR, ETCD, KUBECONFIG, SERVICES, K3sHost, token_verdict
from ..module_utils._host.k3s_change import K3sChange

ARGUMENTS = {
    "role": {"type": "str", "choices": ["server", "agent"], "required": True},
    "files": {"type": "list", "elements": "path", "default": []},
    "token": {"type": "str", "default": "", "no_log": True},
    "agent_token": {"type": "str", "default": "", "no_log": True},
    "servers": {"type": "list", "elements": "str", "default": []},
}
KNOCK = 2.0  # seconds


def looked(host: K3sHost, params: Mapping[str, Any]) -> Facts:
    """What the module returns."""
    role, files, servers = params["role"], params["files"], params["servers"]
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
            "reload": shown.get("NeedDaemonReload") == "yes",
            "installed": shown.get("LoadState") == "loaded",
        },
        "other_service": host.path(f"/etc/systemd/system/{other}.service").exists(),
        "stale": host.stale(service, files),
        "ready": seen.verdict == PASS,
        "observed": str(seen.observed),
        "data": data,
        "etcd": role == "server" and host.path(ETCD).exists(),
        "tokens": {
            name: token_verdict(
                params[option], host.read(f"{CONFIG_DIR}/{file}"), host.read(f"{DATA_DIR}/server/{file}")
            )
            for name, option, file in (("server", "token", "token"), ("agent", "agent_token", "agent-token"))
        },
        "server_url": server_url(host.read(f"{CONFIG_DIR}/config.yaml")),
        "cgroup_refused": cgroup(host)["refused"],
        "answering": [server for server, knock in zip(servers, knocks) if knock["outcome"] == "open"],
        "change": {"unproven": change.unproven, "version": change.version},
        "kubeconfig_sha256": host.describe(KUBECONFIG)["sha256"],
    }


def main() -> None:
    module = AnsibleModule(argument_spec=ARGUMENTS, supports_check_mode=True)
    module.exit_json(changed=False, **looked(K3sHost(module.run_command), module.params))


if __name__ == "__main__":
    main()
