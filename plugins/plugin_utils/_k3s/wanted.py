# SPDX-License-Identifier: GPL-3.0-or-later
"""What k3s is to be on a host, out of the variables of the role k3s: its configuration and the other files.

And where its binary, its images and its tokens come from: the project's releases or a directory of the control node; a
server of the cluster or the inventory.
"""

from __future__ import annotations

import base64
import re
import secrets
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from urllib.parse import quote

import yaml

from ...module_utils._common.documents import Result, Variables
from ...module_utils._common.errors import SpecError
from ...module_utils._host.k3s import (
    AUDIT_POLICY,
    BINARY,
    CONFIG_DIR,
    NEIGHBOURS,
    SERVICES,
    STARTED_WITH,
    STATE,
    SUM_LINE,
    SYSCTLS,
    UNIT_DIRECTORY,
    token_verdict,
)
from .._model.machines import MACHINES
from .._model.topology import address, in_url

HEADER = "# Written by Ansible (rosops.fleet.k3s); changes are overwritten.\n"
# k3s takes a few secrets in its configuration only (S3 keys, an external datastore's address, a VPN's join key), and
# the arguments of its parts may hold more.
SECRET_KEY = re.compile(r"secret(?!s-encryption)|password|datastore-endpoint|s3-proxy|access-key|(^|-)(auth|token)$")
API_PORT = 6443
SECRET_VALUE = re.compile(r"(?i)(key|token|password|secret)=|://[^/\s]*:[^/\s]*@")
# A starting pod must not take the processor from a robot's other pods; a server's API is what other hosts wait for.
WEIGHTS = {"agent": "10", "server": ""}
ARCHIVE_ENDINGS = (".tar.zst", ".tar.gz", ".tar")
FOR_AGENTS = "agent-token"
VARIABLES = {"token": "k3s_token", FOR_AGENTS: "k3s_agent_token"}
CERTIFICATES, TOKEN = "certificates", "token"  # what can be made anew
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
ExecStartPre=-/bin/sh -c 'stat -c "{state}" {started_with} >{record} 2>/dev/null'
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
# By k3s' own guide for the CIS benchmark, as of 1.34 (docs.k3s.io/security/hardening-guide), but for admission: a
# namespace's level is `robot_namespace_pod_security`, and EventRateLimit has no limits that fit all fleets.
KERNEL = """vm.panic_on_oom=0
vm.overcommit_memory=1
kernel.panic=10
kernel.panic_on_oops=1
"""
# The bridge of the pods. By the kernel's own values a host goes on sending to a pod that has ended for a minute. A node
# that is about to connect to that pod waits for up to two minutes: measured with a ROS master that was replaced.
BRIDGE = """net.ipv4.neigh.cni0.base_reachable_time_ms=2000
net.ipv4.neigh.cni0.delay_first_probe_time=1
net.ipv4.neigh.cni0.retrans_time_ms=300
"""
# That of the guide, but for what each node writes every ten seconds: who asked for what, and never what is in it.
AUDIT = {
    "apiVersion": "audit.k8s.io/v1", "kind": "Policy", "omitStages": ["RequestReceived"],
    "rules": [{"level": "None", "namespaces": ["kube-node-lease"]}, {"level": "Metadata"}],
}  # fmt: skip
CIPHERS = (
    "TLS_ECDHE_ECDSA_WITH_AES_256_GCM_SHA384", "TLS_ECDHE_RSA_WITH_AES_256_GCM_SHA384",
    "TLS_ECDHE_ECDSA_WITH_AES_128_GCM_SHA256", "TLS_ECDHE_RSA_WITH_AES_128_GCM_SHA256",
    "TLS_ECDHE_ECDSA_WITH_CHACHA20_POLY1305", "TLS_ECDHE_RSA_WITH_CHACHA20_POLY1305",
)  # fmt: skip
OF_EACH_NODE = {"kubelet-arg": ["streaming-connection-idle-timeout=5m", f"tls-cipher-suites={','.join(CIPHERS)}"]}
OF_SERVERS = {
    "kube-apiserver-arg": [
        "audit-log-path=/var/lib/rancher/k3s/server/logs/audit.log", f"audit-policy-file={AUDIT_POLICY}",
        "audit-log-maxage=30", "audit-log-maxbackup=10", "audit-log-maxsize=100",
        "service-account-extend-token-expiration=false",
    ],
    "kube-controller-manager-arg": ["terminated-pod-gc-threshold=100"],
}  # fmt: skip


@dataclass(frozen=True)
class HostFile:
    """A file of the host; one without content is not to be there."""

    path: str
    content: str
    mode: str
    secret: bool


@dataclass(frozen=True)
class Datastore:
    """What a server's is, or is to be. What is there stays as it is."""

    etcd: bool = False
    encrypts: bool = False  # Secrets in it


PLAIN = Datastore()


@dataclass(frozen=True)
class Wanted:
    """One host's part in its cluster."""

    init: bool  # it starts the cluster; the others join it
    url: str  # where members join, and what goes into the kubeconfig
    files: tuple[HostFile, ...]
    tokens: tuple[str, ...]  # names of the token files that it has, below /etc/rancher/k3s
    started_with: tuple[str, ...]  # if one of them is another one now, k3s must start again
    kubeconfig: str  # its path on the control node; empty where this host gives none
    anew: bool = False  # it joins, though it has joined before
    beside: tuple[HostFile, ...] = ()  # files of the host that k3s does not read
    rotate: str = ""  # what of its secrets is to be made anew: CERTIFICATES, TOKEN


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
    return f"https://{in_url(variables['k3s_api_endpoint']) or address(server, hostvars)}:{API_PORT}"


def wanted(
    variables: Variables, host: str, hostvars: Mapping[str, Variables], joins: str = "", datastore: Datastore = PLAIN
) -> Wanted:
    """`joins` is the server that a member joins, by default the first one. SpecError where a server is no host."""
    role, servers = variables["k3s_role"], variables["k3s_server_hosts"]
    init = role == "server" and servers[:1] == [host]
    url = joins or server_url(variables, servers[0], hostvars)
    # A server that stays alone has SQLite: etcd syncs each write, which wears SD cards out. k3s takes what is in SQLite
    # over into etcd once it starts with cluster-init, and there is no way back.
    joining: dict[str, object] = {"server": url}
    if init:
        joining = {"cluster-init": True} if datastore.etcd or len(servers) > 1 else {}
    if datastore.encrypts:
        joining["secrets-encryption"] = True
    config = _config(variables, joining, variables["k3s_node_ip"].split(",")[0] or address(host, hostvars))
    unit = f"{UNIT_DIRECTORY}/{SERVICES[role]}.service"
    config_file, registries, environment = (
        f"{CONFIG_DIR}/{name}" for name in ("config.yaml", "registries.yaml", "environment")
    )
    tokens = ("token", "agent-token") if role == "server" else ("agent-token",)
    token_files = [f"{CONFIG_DIR}/{name}" for name in tokens]
    hardened = variables["k3s_hardening"]
    hardening = (
        HostFile(SYSCTLS, HEADER + KERNEL if hardened else "", "0644", False),
        HostFile(AUDIT_POLICY, _yaml(AUDIT) if hardened and role == "server" else "", "0600", False),
    )
    # what is not asked for is in no record: the record of each k3s that is there would be another one
    read = [file.path for file in hardening if file.content]
    started_with = (config_file, unit, registries, environment, *read, *token_files, BINARY)
    secret = any(SECRET_KEY.search(key) or SECRET_VALUE.search(str(value)) for key, value in config.items())
    given = sorted(variables["k3s_environment"].items(), key=lambda one: one[0].lower())
    variables_text = "".join(f"{name}={_quoted(str(value))}\n" for name, value in given if value is not None)
    files = (
        HostFile(config_file, _yaml(config), "0600", secret),
        HostFile(unit, unit_text(role, started_with, variables), "0644", False),
        HostFile(registries, _yaml(variables["k3s_registries"]), "0600", True),
        HostFile(environment, HEADER + variables_text if variables_text else "", "0600", True),
        *hardening,
    )
    path = variables["k3s_kubeconfig_path"]
    kubeconfig = str(Path(path).expanduser()) if init and path else ""
    anew = role == "agent" and enrolled(variables, host)
    beside = (HostFile(NEIGHBOURS, HEADER + BRIDGE, "0644", secret=False),)
    return Wanted(init, url, files, tokens, started_with, kubeconfig, anew, beside)


def enrolled(variables: Variables, host: str) -> bool:
    """Whether somebody named it as one that is to join anew."""
    return host in map(str.strip, variables["k3s_enrol"].split(","))


def _config(variables: Variables, joining: Mapping[str, object], own_address: str) -> dict[str, object]:
    """What differs between a cluster's first server, its other servers and its agents is seen at once."""
    config: dict[str, object] = {"node-name": variables["k3s_node_name"], "node-ip": variables["k3s_node_ip"] or None}
    if variables["k3s_role"] == "server":
        # without the brackets that they have in a URL: the certificate is to be for an address, not for a name
        names = [own_address.strip("[]"), variables["k3s_node_name"], variables["k3s_api_endpoint"].strip("[]")]
        names += variables["k3s_tls_sans"]
        config |= {
            "write-kubeconfig-mode": "0600",
            "disable": ["traefik", "servicelb"],
            "tls-san": list(dict.fromkeys(name for name in names if name)),
            "token-file": f"{CONFIG_DIR}/token",
        }
    config["agent-token-file" if variables["k3s_role"] == "server" else "token-file"] = f"{CONFIG_DIR}/agent-token"
    config |= {**joining, **variables["k3s_config"]}
    if variables["k3s_hardening"]:
        config = _hardened(config, variables["k3s_role"])
    return {key: value for key, value in config.items() if value is not None}


def _hardened(config: Mapping[str, object], role: str) -> dict[str, object]:
    """With what hardens k3s. What the operator says of the same comes last, and by that counts; null takes it out."""
    hardened: dict[str, object] = {"protect-kernel-defaults": True, **config}
    for key, arguments in (OF_EACH_NODE | (OF_SERVERS if role == "server" else {})).items():
        own = config.get(key, [])
        if own is not None:
            hardened[key] = [*arguments, *(own if isinstance(own, list) else [own])]
    return hardened


def _quoted(value: str) -> str:
    """As systemd reads it in a file of variables: all but these two stands for itself."""
    return '"{}"'.format(re.sub(r'(["\\])', r"\\\1", value))


def _yaml(value: Mapping[str, object]) -> str:
    return HEADER + yaml.safe_dump(value, allow_unicode=True, default_flow_style=False) if value else ""


def unit_text(role: str, started_with: Sequence[str], variables: Variables) -> str:
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
        # with `protect-kernel-defaults` the kubelet ends where these are others
        "ExecStartPre": f"-/sbin/sysctl -p {SYSCTLS}" if variables["k3s_hardening"] else "",
    }
    lines = "\n".join(f"{name}={value}" for name, value in limits.items() if value != "")
    read, record = " ".join(started_with), STARTED_WITH.format(service=SERVICES[role])
    return HEADER + UNIT.format(
        role=role, state=STATE.replace("%", "%%"), started_with=read, record=record, binary=BINARY, limits=lines
    )


# --- where it comes from ----------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Artifacts:
    """Binary and archive for one machine. What does not apply is empty.

    `sha256` is the binary's, empty where only the release's own list of sums (`sums`, a URL) has it. `archive_name` is
    the archive's name on the host: it holds the digest, so neither end needs to read hundreds of MB to compare.
    """

    sha256: str = ""
    path: str = ""  # of the binary on the control node
    url: str = ""  # of the binary in the releases
    sums: str = ""
    archive_name: str = ""
    archive_path: str = ""
    archive_sha256: str = ""
    archive_size: int = 0


def source(variables: Variables, machine: str) -> Artifacts:
    """The source that the role's variables choose; SpecError if the airgap directory lacks something."""
    if variables["k3s_install_source"] == "airgap":
        return _airgap(variables["k3s_airgap_dir"], machine)
    known = MACHINES[machine]
    release = f"{variables['k3s_release_url']}/{quote(variables['k3s_version'])}"
    return Artifacts(
        sha256=variables["k3s_release_checksums"].get(machine) or "",
        url=f"{release}/k3s{known.suffix}",
        sums=f"{release}/sha256sum-{known.architecture}.txt",
    )


def _airgap(directory: str, machine: str) -> Artifacts:
    """What the directory has for a machine by its SHA256SUMS; of several packings of the images the smallest."""
    # from the current directory on, as it is looked at here: Ansible's copy has other places for a relative path
    base, known = Path(directory).expanduser().absolute(), MACHINES[machine]
    binary = f"k3s{known.suffix}"
    archives = [f"k3s-airgap-images-{known.architecture}{ending}" for ending in ARCHIVE_ENDINGS]
    try:
        sums = _sums((base / "SHA256SUMS").read_text("utf-8", "replace"))
        if binary not in sums:
            raise SpecError(f"SHA256SUMS has no line for {binary}, which hosts of {machine} need")
        (base / binary).stat()
        images = next((name for name in archives if name in sums), "")
        size = (base / images).stat().st_size if images else 0
    except OSError as error:
        raise SpecError(f"k3s_airgap_dir {base}: {error.filename} cannot be read: {error.strerror}") from error
    found = Artifacts(sha256=sums[binary], path=str(base / binary))
    if not images:
        return found
    name, path, digest = images.replace(".tar", f"-{sums[images][:12]}.tar"), str(base / images), sums[images]
    return replace(found, archive_name=name, archive_path=path, archive_sha256=digest, archive_size=size)


def _sums(manifest: str) -> dict[str, str]:
    """File to SHA-256, out of what sha256sum wrote."""
    sums: dict[str, str] = {}
    for number, line in enumerate(manifest.splitlines(), start=1):
        if found := SUM_LINE.match(line.strip()):
            sums[found.group(2)] = found.group(1)
        elif line.strip():
            raise SpecError(f"SHA256SUMS, line {number}, is no line of sha256sum: {line.strip()[:80]!r}")
    return sums


def tokens_to_keep(names: Iterable[str], read: Sequence[Result], variables: Variables) -> dict[str, str]:
    """Name of a token's file to its text: what the first server hands out, else the inventory's, else a new one.

    `read` is what slurp returned for each file of the servers that could be asked, in their order; empty on the first
    server itself. The full form of a token (K10...) lets a member check that it talks to the right cluster before it
    says a word. SpecError where the inventory's is not the cluster's.
    """
    joined = {
        PurePosixPath(file["source"]).name: base64.b64decode(file["content"]).decode().strip()
        for file in reversed(read)
        if "content" in file
    }
    wrong = [
        VARIABLES[name]
        for name, text in joined.items()
        if variables[VARIABLES[name]] and token_verdict(variables[VARIABLES[name]], text, "") != "same"
    ]
    if wrong:
        cluster = variables["k3s_cluster"]
        raise SpecError(f"{', '.join(wrong)} is not the one that the cluster {cluster} runs with; nothing was changed.")
    return {name: joined.get(name) or variables[VARIABLES[name]] or secrets.token_hex(24) for name in names}
