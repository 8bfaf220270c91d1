# SPDX-License-Identifier: GPL-3.0-or-later
"""What k3s is to be on a host: its configuration and the other files, out of the variables of the role k3s. Pure."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import yaml

from ...module_utils._common.documents import Result, Variables
from ...module_utils._host.k3s import BINARY, CONFIG_DIR, SERVICES, STARTED_WITH, UNIT_DIRECTORY
from .._model.topology import address

HEADER = "# Written by Ansible (rosops.fleet.k3s); changes are overwritten.\n"
# k3s takes a few secrets in its configuration only (S3 keys, an external datastore's address, a VPN's join key), and
# the arguments of its parts may hold more.
SECRET_KEY = re.compile(r"secret|password|datastore-endpoint|s3-proxy|access-key|(^|-)(auth|token)$")
API_PORT = 6443
SECRET_VALUE = re.compile(r"(?i)(key|token|password|secret)=|://[^/\s]*:[^/\s]*@")
# A starting pod must not take the processor from a robot's other pods; a server's API is what other hosts wait for.
WEIGHTS = {"agent": "10", "server": ""}
UNIT = """[Unit]
Description=k3s {role}
Documentation=https://docs.k3s.io
Wants=network-online.target
After=network-online.target

[Service]
Type=notify
EnvironmentFile=-/etc/rancher/k3s/environment
ExecStartPre=-/sbin/modprobe br_netfilter
ExecStartPre=-/sbin/modprobe overlay
# What this start reads, for the role to see whether a restart is due.
ExecStartPre=-/bin/sh -c 'stat -c "%%n %%i %%s %%Y" {started_with} >{record} 2>/dev/null'
ExecStart={binary} {role}
# Pods outlive a restart of k3s, and have cgroups of their own.
KillMode=process
Delegate=yes
{limits}
# A robot that boots without its server's network goes on trying; the role has a time limit of its own.
TimeoutStartSec=0
Restart=always
RestartSec=5s

[Install]
WantedBy=multi-user.target
"""


@dataclass(frozen=True)
class HostFile:
    """A file of the host; one without content is not to be there."""

    path: str
    content: str
    mode: str
    secret: bool


@dataclass(frozen=True)
class Wanted:
    """One host's part in its cluster."""

    role: str
    service: str
    init: bool  # it starts the cluster; the others join it
    url: str  # where members join, and what goes into the kubeconfig
    files: tuple[HostFile, ...]
    tokens: tuple[str, ...]  # names of the token files that it has, below /etc/rancher/k3s
    started_with: tuple[str, ...]  # if one of them is another one now, k3s must start again
    kubeconfig: str  # its path on the control node; empty where this host gives none


def join_url(variables: Variables, hostvars: Mapping[str, Variables], now: Result) -> str:
    """Where a member joins; `now` is what k3s_facts found.

    One that has joined keeps its server as long as that is one of the cluster's: it knows them all by now, and another
    address would be a restart. A new one takes the first server that answers it.
    """
    urls = [server_url(variables, server, hostvars) for server in variables["k3s_server_hosts"]]
    if now["data"] and now["server_url"] in urls:
        return str(now["server_url"])
    return next((url for url in urls if url.removeprefix("https://") in now["answering"]), urls[0])


def server_url(variables: Variables, server: str, hostvars: Mapping[str, Variables]) -> str:
    """A server's API, or what stands in front of all servers; SpecError where it is no host of the inventory."""
    return f"https://{variables['k3s_api_endpoint'] or address(server, hostvars)}:{API_PORT}"


def wanted(
    variables: Variables, host: str, hostvars: Mapping[str, Variables], joins: str = "", etcd: bool = False
) -> Wanted:
    """`joins` is the server that a member joins, by default the first one; `etcd`: the host has such a datastore.

    SpecError where a server is no host.
    """
    role, servers = variables["k3s_role"], variables["k3s_server_hosts"]
    service = SERVICES[role]
    init = role == "server" and servers[:1] == [host]
    url = joins or server_url(variables, servers[0], hostvars)
    # A server that stays alone has SQLite: etcd syncs each write, which wears SD cards out. k3s takes what is in SQLite
    # over into etcd once it starts with cluster-init, and there is no way back.
    joining: dict[str, object] = {"server": url}
    if init:
        joining = {"cluster-init": True} if etcd or len(servers) > 1 else {}
    config = _config(variables, joining, variables["k3s_node_ip"].split(",")[0] or address(host, hostvars))
    unit = f"{UNIT_DIRECTORY}/{service}.service"
    config_file, registries, environment = (
        f"{CONFIG_DIR}/{name}" for name in ("config.yaml", "registries.yaml", "environment")
    )
    tokens = ("token", "agent-token") if role == "server" else ("agent-token",)
    token_files = [f"{CONFIG_DIR}/{name}" for name in tokens]
    started_with = (config_file, unit, registries, environment, *token_files, BINARY)
    secret = any(SECRET_KEY.search(key) or SECRET_VALUE.search(str(value)) for key, value in config.items())
    files = (
        HostFile(config_file, _yaml(config), "0600", secret),
        HostFile(unit, unit_text(role, service, started_with, variables), "0644", False),
        HostFile(registries, _yaml(variables["k3s_registries"]), "0600", True),
        HostFile(environment, environment_text(variables["k3s_environment"]), "0600", True),
    )
    path = variables["k3s_kubeconfig_path"]
    kubeconfig = str(Path(path).expanduser()) if init and path else ""
    return Wanted(role, service, init, url, files, tokens, started_with, kubeconfig)


def _config(variables: Variables, joining: Mapping[str, object], own_address: str) -> dict[str, object]:
    """What differs between a cluster's first server, its other servers and its agents is seen at once."""
    config: dict[str, object] = {"node-name": variables["k3s_node_name"], "node-ip": variables["k3s_node_ip"] or None}
    if variables["k3s_role"] == "server":
        # without the brackets that it has in a URL: the certificate is to be for an address, not for a name
        names = [own_address.strip("[]"), variables["k3s_node_name"], variables["k3s_api_endpoint"]]
        names += variables["k3s_tls_sans"]
        config |= {
            "write-kubeconfig-mode": "0600",
            "disable": ["traefik", "servicelb"],
            "tls-san": list(dict.fromkeys(name for name in names if name)),
            "token-file": f"{CONFIG_DIR}/token",
        }
    config["agent-token-file" if variables["k3s_role"] == "server" else "token-file"] = f"{CONFIG_DIR}/agent-token"
    return {key: value for key, value in {**config, **joining, **variables["k3s_config"]}.items() if value is not None}


def _yaml(value: Mapping[str, object]) -> str:
    return HEADER + yaml.safe_dump(value, allow_unicode=True, default_flow_style=False) if value else ""


def unit_text(role: str, service: str, started_with: Sequence[str], variables: Variables) -> str:
    """The unit; `started_with` are the files whose state it records when it starts."""
    weight = WEIGHTS[role] if variables["k3s_cpu_weight"] == "auto" else variables["k3s_cpu_weight"]
    limits = {
        # in system.slice it would be a weight against other services, and not against pods, which are beside that
        "Slice": "-.slice" if weight else "",
        "CPUWeight": weight,
        # as k3s' own unit has them
        "LimitNOFILE": "1048576",
        "LimitNPROC": "infinity",
        "LimitCORE": "infinity",
        "TasksMax": "infinity",
    }
    lines = "\n".join(f"{name}={value}" for name, value in limits.items() if value != "")
    read, record = " ".join(started_with), STARTED_WITH.format(service=service)
    return HEADER + UNIT.format(role=role, started_with=read, record=record, binary=BINARY, limits=lines)


def environment_text(environment: Variables) -> str:
    """The unit's environment; empty if there is none. systemd reads a value as C does, which JSON's quotes are."""
    lines = (f"{name}={json.dumps(str(environment[name]))}\n" for name in sorted(environment, key=str.lower))
    return HEADER + "".join(lines) if environment else ""
