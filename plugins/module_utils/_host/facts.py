# SPDX-License-Identifier: GPL-3.0-or-later
"""What a host is, read from /proc, /sys, /etc and its sockets, and what k3s is there. Reads only; judges nothing."""

from __future__ import annotations

import os
import re
import socket
import ssl
import time
from functools import partial
from pathlib import Path
from typing import Any, Dict, Iterable

from .._common.documents import Arguments
from .._common.poll import PASS
from .._ros.rpc import in_parallel
from . import k3s
from .k3s import Host, K3sHost
from .k3s_change import K3sChange

Facts = Dict[str, object]  # as they are written as JSON
TOKENS = ("token", "agent-token")

V2_CONTROLLERS = "/sys/fs/cgroup/cgroup.controllers"
# where k3s's kubelet reads files of the operator's own
KUBELET_CONFIG = "/var/lib/rancher/k3s/agent/etc/kubelet.conf.d"
CGROUP_V1_ALLOWED = re.compile(r"^failCgroupV1:\s*false\b", re.MULTILINE)
CMDLINE_FILES = ("/boot/firmware/cmdline.txt", "/boot/cmdline.txt")
MEMORY = re.compile(r"^MemTotal:\s+(\d+) kB", re.MULTILINE)
OS_RELEASE = re.compile(r"^(\w+)=[\"']?(.*?)[\"']?\s*$", re.MULTILINE)
TCP_LISTEN = "0A"
UDP_UNCONNECTED = "07"
PARENT = "/var/lib/rancher"  # on the file system that holds what k3s has
# flannel's overlay, and the sets of k3s's network policies
MODULES = ("vxlan", "ip_set")
POLICIES = ("/usr/share/selinux/packages/k3s.pp", "/etc/selinux/targeted/active/modules/200/k3s")
UFW_ON = re.compile(r"^ENABLED=yes\b", re.MULTILINE)
KNOCK = 2.0  # seconds for a server of k3s
KUBELET = f"{k3s.DATA_DIR}/agent/client-kubelet.crt"  # written anew at each start of an agent; it holds for a year
LIFE = 360 * 86400.0
AUTHORITY = f"{k3s.DATA_DIR}/agent/server-ca.crt"  # of the cluster that the host joined
OUT_OF_TIME = (9, 10)  # OpenSSL's X509_V_ERR_CERT_NOT_YET_VALID and _HAS_EXPIRED
SERVER_URL = re.compile(r"^\s*[\"']?server[\"']?\s*:\s*[\"']?([^\s\"'#]+)", re.MULTILINE)


def system(host: Host) -> Facts:
    release = dict(OS_RELEASE.findall(host.read("/etc/os-release")))
    name, memory = os.uname(), MEMORY.search(host.read("/proc/meminfo"))
    return {
        "os": {"id": release.get("ID", ""), "name": release.get("PRETTY_NAME", "")},
        "kernel": name.release,
        "machine": name.machine,
        "hostname": name.nodename,
        "machine_id": host.read("/etc/machine-id").strip(),
        "board": host.read("/proc/device-tree/model").strip(),
        "systemd": host.exists("/run/systemd/system"),
        "root": os.geteuid() == 0,
        "overlay": "overlay" in host.read("/proc/filesystems").split(),
        "memory_mb": int(memory.group(1)) // 1024 if memory else 0,
    }


def cgroup(host: Host) -> Facts:
    """The controllers that are switched on, and the boot command line that could switch on more.

    `refused`: the kubelet of Kubernetes 1.35 and newer does not start with this version.
    """
    unified = host.read(V2_CONTROLLERS)
    if unified:
        version, controllers = 2, unified.split()
    else:
        rows = [line.split() for line in host.read("/proc/cgroups").splitlines() if not line.startswith("#")]
        version, controllers = 1, [row[0] for row in rows if len(row) == 4 and row[3] == "1"]
    settings = (host.read(f"{KUBELET_CONFIG}/{name}") for name in host.names(KUBELET_CONFIG) if name.endswith(".conf"))
    allowed = any(CGROUP_V1_ALLOWED.search(text) for text in settings)
    file = next((name for name in CMDLINE_FILES if host.exists(name)), "")
    return {
        "version": version,
        "refused": version == 1 and not allowed,
        "controllers": sorted(controllers),
        "cmdline": host.read("/proc/cmdline").strip(),
        "cmdline_file": file,
    }


def disk(host: Host, directory: str) -> Facts:
    """The file system that holds `directory`, or will hold it once it is made, wherever a link leads."""
    place = Path(directory)
    while not host.exists(str(place)) and place != place.parent:
        place = place.parent
    there = host.path(str(place)).resolve(strict=True)
    numbers = os.statvfs(str(there))
    block = numbers.f_frsize / 1048576
    return {
        "path": directory,
        "total_mb": int(numbers.f_blocks * block),
        "free_mb": int(numbers.f_bavail * block),
        # btrfs and others count no inodes and say 0 of 0
        "free_inodes": numbers.f_favail if numbers.f_files else None,
        "type": filesystem_type(host.read("/proc/self/mounts"), str("/" / there.relative_to(host.root.resolve()))),
    }


def filesystem_type(mounts: str, directory: str) -> str:
    best, kind = "", ""
    for row in (line.split() for line in mounts.splitlines()):
        if len(row) < 3:
            continue
        point = row[1].replace("\\040", " ")
        inside = directory == point or directory.startswith(point.rstrip("/") + "/")
        if inside and len(point) >= len(best):  # a later mount over the same point hides the earlier one
            best, kind = point, row[2]
    return kind


def routes(host: Host) -> list[Facts]:
    """The default routes, IPv4 before IPv6, best metric first."""
    found: list[tuple[int, int, str]] = []
    for row in (line.split() for line in host.read("/proc/net/route").splitlines()[1:]):
        if len(row) >= 8 and row[1] == row[7] == "00000000":
            found.append((4, int(row[6]), row[0]))
    for row in (line.split() for line in host.read("/proc/net/ipv6_route").splitlines()):
        if len(row) >= 10 and row[0] == "0" * 32 and row[1] == "00" and row[9] != "lo":
            found.append((6, int(row[5], 16), row[9]))
    sizes = {name: int(host.read(f"/sys/class/net/{name}/mtu").strip() or 0) for _family, _metric, name in found}
    return [{"family": family, "interface": name, "mtu": sizes[name]} for family, _metric, name in sorted(found)]


def listening(host: Host, ports: Iterable[tuple[str, int]]) -> list[Facts]:
    """Who listens on the named (protocol, port) pairs."""
    wanted = set(ports)
    sockets: dict[str, tuple[str, int]] = {}
    for protocol, state in (("tcp", TCP_LISTEN), ("udp", UDP_UNCONNECTED)):
        for table in (f"/proc/net/{protocol}", f"/proc/net/{protocol}6"):
            for row in (line.split() for line in host.read(table).splitlines()[1:]):
                if len(row) > 9 and row[3] == state:
                    pair = (protocol, int(row[1].rpartition(":")[2], 16))
                    if pair in wanted:
                        sockets[row[9]] = pair
    owners = socket_owners(host, sockets) if sockets else {}
    held = {(*pair, *owners.get(inode, ("", False))) for inode, pair in sockets.items()}
    return [dict(zip(("protocol", "port", "process", "k3s"), row)) for row in sorted(held)]


def socket_owners(host: Host, inodes: Iterable[str]) -> dict[str, tuple[str, bool]]:
    """Socket inode -> name of a process that holds it, and whether it belongs to k3s's unit.

    Names alone do not tell: k3s starts parts of itself again under other names. The kernel's own sockets (VXLAN) have
    no process.
    """
    wanted = {f"socket:[{inode}]": inode for inode in inodes}
    owners: dict[str, tuple[str, bool]] = {}
    for pid in (name for name in host.names("/proc") if name.isdigit()):
        for descriptor in host.names(f"/proc/{pid}/fd"):
            try:
                target = os.readlink(str(host.path(f"/proc/{pid}/fd/{descriptor}")))
            except OSError:
                continue
            if target in wanted:
                ours = bool(k3s.UNIT_CGROUP.search(host.read(f"/proc/{pid}/cgroup")))
                owners[wanted[target]] = (host.read(f"/proc/{pid}/comm").strip(), ours)
        if len(owners) == len(wanted):
            break
    return owners


def k3s_leftovers(host: Host) -> dict[str, Any]:
    config = host.read(f"{k3s.CONFIG_DIR}/config.yaml")
    server = SERVER_URL.search(config)
    there = {f"{unit}.service": f"{k3s.UNIT_DIRECTORY}/{unit}.service" for unit in k3s.SERVICES.values()}
    units = {unit: host.read(path) for unit, path in there.items() if host.exists(path)}
    return {
        "config": bool(config),
        "server_url": server.group(1) if server else "",
        "node_password": host.exists("/etc/rancher/node/password"),
        "server_data": bool(host.names(f"{k3s.DATA_DIR}/server/db")),
        "agent_data": host.exists(KUBELET),
        "units": list(units),
        "foreign_units": [unit for unit, text in units.items() if "rosops.fleet" not in text],
    }


def foreign(connection: socket.socket, authority: str) -> bool:
    """Whether the API there has a certificate of another authority than the one in this file."""
    trust = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    trust.check_hostname = False
    try:
        trust.load_verify_locations(authority)
        trust.wrap_socket(connection).close()
    except ssl.SSLCertVerificationError as error:
        return error.verify_code not in OUT_OF_TIME
    except ssl.SSLError:  # nothing is known of its certificate
        pass
    return False


def knock(address: str, port: int, timeout: float, authority: str = "") -> str:
    """A connection and nothing more. `refused` is an answer: the host is there, the port is not open yet. `foreign`
    is an API of another `authority` than the one in this file.
    """
    try:
        with socket.create_connection((address, port), timeout) as connection:
            return "foreign" if authority and foreign(connection, authority) else "open"
    except ConnectionRefusedError:
        return "refused"
    except socket.gaierror:
        return "unresolved"
    except socket.timeout:
        return "timeout"
    except OSError as error:
        return os.strerror(error.errno).lower() if error.errno else "unreachable"


def reach(targets: list[str], timeout: float, authority: str = "") -> list[Facts]:
    """All knocks at once: three silent servers cost one time-out, not three."""
    places = [(host.strip("[]"), int(port)) for host, _colon, port in (target.rpartition(":") for target in targets)]
    knocks = {(host, port): partial(knock, host, port, timeout, authority) for host, port in places}
    # a resolver that hangs has no time-out of its own
    found = in_parallel(knocks, 2 * timeout, lambda _place, _error: "timeout")
    return [{"host": host, "port": port, "outcome": found[host, port]} for host, port in places]


def firewalls(host: Host) -> list[str]:
    """Those that drop what nobody allowed. systemd keeps a service's cgroup as long as that runs."""
    groups = (f"/sys/fs/cgroup/{below}system.slice/firewalld.service" for below in ("", "systemd/"))
    on = {"ufw": UFW_ON.search(host.read("/etc/ufw/ufw.conf")), "firewalld": any(map(host.exists, groups))}
    return [name for name, found in on.items() if found]


def selinux(host: Host) -> Facts:
    mode = {"1": "enforcing", "0": "permissive"}.get(host.read("/sys/fs/selinux/enforce").strip(), "")
    return {"mode": mode, "policy": any(host.exists(name) for name in POLICIES)}


def lacking(host: Host, release: str) -> list[str]:
    """Modules that the kernel neither has nor could load. Without a list of what it has nothing is known to lack."""
    lists = [host.read(f"/lib/modules/{release}/{name}") for name in ("modules.dep", "modules.builtin")]
    if not any(lists):
        return []
    known = "\n".join(lists)
    return [
        name for name in MODULES if not host.exists(f"/sys/module/{name}") and not re.search(rf"/{name}\.ko\b", known)
    ]


def collect(host: Host, ports: Iterable[tuple[str, int]], targets: list[str], timeout: float) -> Facts:
    """Everything the verdicts of `_preflight` need, in one go."""
    return {
        **system(host),
        "cgroup": cgroup(host),
        "disk": disk(host, PARENT),
        "routes": routes(host),
        "listening": listening(host, ports),
        "reach": reach(targets, timeout),
        "k3s": k3s_leftovers(host),
        # what stands between pods and their network
        "network": {
            "firewalls": firewalls(host),
            "selinux": selinux(host),
            "lacking": lacking(host, os.uname().release),
        },
    }


def k3s_facts(host: K3sHost, asked: Arguments) -> Facts:
    """What decides whether something is to be done about k3s.

    `asked` are the `role` that the host is to have, the `files` that k3s reads when it starts, those `beside` them,
    `token` and `agent_token` as the inventory gives them (empty: keep those that are there), and the `servers` as
    address:port.

    `stale`: k3s was started with other files. `data`: there is a datastore (server; of one that is `external`, what k3s
    wrote once it ran) or a node's certificate (agent). `answering`: of the servers; `foreign`: of these such as are
    of another cluster than the one that the host has joined, which was made anew or has the same address. `lapsed`:
    the node's certificate is of no more use to it. `encrypts`: Secrets in the datastore are. `cgroup_refused`: k3s 1.35
    and newer does not start here. `tokens` are verdicts alone, and `change` is the last exchange, `renewed` where it
    has made the certificates anew and nobody has proven it. The token for agents may become another one, which k3s
    itself has written down only after its next start.
    """
    role, files, servers = asked["role"], asked["files"], asked["servers"]
    service, other = k3s.SERVICES[role], k3s.SERVICES["agent" if role == "server" else "server"]
    shown = host.show(service)
    # what runs now runs, however often it had to be started before
    seen = host.look(role, restarts_before=int(shown.get("NRestarts") or 0))
    last, there = K3sChange(host.run, role, str(host.root)), k3s_leftovers(host)
    change = last.record()
    data = there["server_data" if role == "server" else "agent_data"]
    data = data or (asked["external"] and role == "server" and host.exists(f"{k3s.DATA_DIR}/server/token"))
    joined = str(host.path(AUTHORITY)) if data and host.exists(AUTHORITY) else ""
    knocks = dict(zip(servers, reach(servers, KNOCK, joined)))
    places = k3s.CONFIG_DIR, f"{k3s.DATA_DIR}/server"
    kept, known = ([host.read(f"{place}/{name}") for name in TOKENS] for place in places)
    return {
        "machine": os.uname().machine,
        "version": host.version(),
        "files": {name: host.describe(name) for name in dict.fromkeys([*files, *asked["beside"], k3s.BINARY])},
        "images": host.sizes(f"{k3s.DATA_DIR}/agent/images"),
        "service": {
            "active": shown.get("ActiveState", "inactive"),
            "enabled": shown.get("UnitFileState") == "enabled",
            "installed": shown.get("LoadState") == "loaded",
        },
        "other_service": f"{other}.service" in there["units"],
        "stale": host.stale(service, files),
        "ready": seen.verdict == PASS,
        "data": data,
        "etcd": role == "server" and host.path(k3s.ETCD).exists(),
        "encrypts": role == "server" and host.path(k3s.ENCRYPTION).exists(),
        "lapsed": role == "agent" and data and time.time() - host.path(KUBELET).stat().st_mtime > LIFE,
        "tokens": {
            "server": k3s.token_verdict(asked["token"], kept[0], known[0]),
            "agent": k3s.token_verdict(asked["agent_token"], kept[1], "" if kept[1] else known[1]),
        },
        "server_url": there["server_url"],
        "cgroup_refused": cgroup(host)["refused"],
        "answering": [server for server, knock in knocks.items() if knock["outcome"] in ("open", "foreign")],
        "foreign": [server for server, knock in knocks.items() if knock["outcome"] == "foreign"],
        "change": {"unproven": change.unproven, "version": change.version, "renewed": last.renewed()},
        "kubeconfig_sha256": host.describe(k3s.KUBECONFIG)["sha256"],
    }
