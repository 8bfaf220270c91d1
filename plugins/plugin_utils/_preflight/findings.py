# SPDX-License-Identifier: GPL-3.0-or-later
"""What a host's part in its cluster makes it need, and by its facts what is wrong with it. Pure: only data is read.

A finding says what is wrong, where that was seen and what to do. An error stops the host, a warning does not.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from typing import NamedTuple

from ...module_utils._common.documents import Arguments, Result, Variables
from ...module_utils._common.errors import printable
from .._model.machines import CGROUP_V2_FROM, EVICTION_FREE_PERCENT, IMAGE_GC_USED_PERCENT, MACHINES, version
from .._model.topology import address

ERROR, WARNING = "error", "warning"
CONTROLLERS = ("cpu", "cpuset", "memory", "pids")
ANSWERS = ("open", "refused")
MINIMUM_MTU = 1280  # IPv6 needs it
LABEL = re.compile(r"^[a-z0-9]([-a-z0-9]{0,61}[a-z0-9])?$")
# overlayfs cannot have these as its upper layer, and containerd's snapshots are overlays
UNFIT_FILESYSTEMS = ("overlay", "nfs", "nfs4", "cifs", "vfat", "exfat", "ntfs", "tmpfs", "ramfs", "squashfs")
PORTS = {
    "server": "6443/tcp (API), 10250/tcp (kubelet), 8472/udp (flannel), with several servers 2379-2380/tcp (etcd)",
    "agent": "10250/tcp (kubelet, from the servers), 8472/udp (flannel, from all nodes)",
}
NETWORKS = "10.42.0.0/16 and 10.43.0.0/16"
ALLOW = {
    "firewalld": "firewall-cmd --permanent --zone=trusted --add-source=10.42.0.0/16 --add-source=10.43.0.0/16, "
    "--add-port for each of the ports, then firewall-cmd --reload; or systemctl disable --now firewalld",
    "ufw": "ufw allow from 10.42.0.0/16, ufw allow from 10.43.0.0/16, ufw allow for each of the ports; or ufw disable",
}
WITHOUT = {"vxlan": "flannel cannot connect the pods of different nodes", "ip_set": "NetworkPolicies are not enforced"}
PI_OPTIONS = "cgroup_enable=cpuset cgroup_enable=memory cgroup_memory=1"
API = 6443
ETCD = (2379, 2380)
# what k3s takes on its host: API, load balancer of the agent part, etcd, kubelet, flannel's VXLAN
TAKEN = {
    "server": (("tcp", API), ("tcp", 6444), *(("tcp", port) for port in ETCD), ("tcp", 10250), ("udp", 8472)),
    "agent": (("tcp", 6444), ("tcp", 10250), ("udp", 8472)),
}
# the options of an action that say a host's part
PART = {
    "role": {"type": "str", "choices": [*TAKEN], "required": True},
    "servers": {"type": "list", "elements": "str", "required": True},
}
TIMEOUT = 3.0  # seconds for the answer of a server


def server_addresses(servers: Sequence[str], host: str, hostvars: Mapping[str, Variables]) -> list[str]:
    """Where the cluster's other servers are."""
    return [address(server, hostvars) for server in servers if server != host]


def look(role: str, others: Sequence[str]) -> Arguments:
    """The arguments of the job `facts`. A server talks to the others' etcd, too; one that is alone has none."""
    etcd = ETCD if role == "server" else ()
    return {
        "ports": [{"port": port, "protocol": protocol} for protocol, port in TAKEN[role] if others or port not in ETCD],
        "reach": [f"{server}:{port}" for server in others for port in (API, *etcd)],
        "timeout": TIMEOUT,
    }


# ---- what is wrong


class Finding(NamedTuple):
    severity: str
    what: str
    where: str
    fix: str


error, warning = partial(Finding, ERROR), partial(Finding, WARNING)


def clock_offset(sent: float, began: float, ended: float, received: float) -> dict[str, float]:
    """The host's clock minus ours, from one call.

    `sent` and `received` are our clock around the call; `began` and `ended` the host's inside it. The module's own work
    (`ended - began`) is no part of the way there and back, so the offset lies between `ended - received` and
    `began - sent`.
    """
    low, high = ended - received, began - sent
    return {"offset": round((low + high) / 2, 3), "uncertainty": round(abs(high - low) / 2, 3)}


def comparable(facts: Result) -> bool:
    """Whether other hosts can be measured against these facts: one that tells nonsense must not keep them."""
    try:
        return all(isinstance(facts[key], str) for key in ("hostname", "machine_id")) and route_mtu(facts) >= 0
    except (ArithmeticError, LookupError, TypeError, ValueError):
        return False


def fleet_findings(name: str, fleet: Mapping[str, Result]) -> Iterable[Finding]:
    """What is wrong with one host only because of another one: the same name, a different MTU."""
    mine, order = fleet[name], list(fleet)
    others = {host: facts for host, facts in fleet.items() if host != name}
    twins = [host for host, facts in others.items() if facts["hostname"].lower() == mine["hostname"].lower()]
    if twins:
        # The one that comes first keeps the name and goes on: a copied SD card must not stop the fleet's server.
        say = warning if order.index(name) < min(map(order.index, twins)) else error
        what = f"the host name {mine['hostname']} is also that of {', '.join(sorted(twins))}"
        yield say(what, "uname -n", "give every host its own name: hostnamectl set-hostname NAME")
    twins = [host for host, facts in others.items() if facts["machine_id"] == mine["machine_id"]]
    if mine["machine_id"] and twins:
        why = "as after copying an SD card: DHCP may give both the same address"
        what = f"the machine ID is also that of {', '.join(sorted(twins))}, {why}"
        yield warning(what, "/etc/machine-id", "rm /etc/machine-id && systemd-machine-id-setup, then reboot")
    sizes = {host: route_mtu(facts) for host, facts in fleet.items() if route_mtu(facts)}
    largest = max(sizes.values(), default=0)
    if sizes.get(name, largest) != largest:
        larger = sorted(host for host, size in sizes.items() if size == largest)
        what = (
            f"the MTU is {sizes[name]}, but {largest} on {', '.join(larger)}: large packets between them may get lost"
        )
        fix = f"set one MTU on all hosts, or flannel's to that of the smallest link (here {min(sizes.values())})"
        yield warning(what, f"interface {mine['routes'][0]['interface']}", fix)


def route_mtu(facts: Result) -> int:
    return int(facts["routes"][0]["mtu"]) if facts["routes"] else 0


def _platform(facts: Result, wanted: Variables) -> Iterable[Finding]:
    system = facts["os"]
    if facts["machine"] not in MACHINES:
        what = f"there is no k3s for the architecture {facts['machine']}"
        yield error(what, "uname -m", f"use a host with one of {', '.join(sorted(MACHINES))}")
    if system["id"] not in wanted["preflight_systems"]:
        what = f"{system['name'] or 'the operating system'} is none of the systems this was made for"
        add = f"add {system['id'] or 'its ID'} to preflight_systems once it has proved itself"
        yield warning(what, "/etc/os-release", f"expected one of {', '.join(wanted['preflight_systems'])}; {add}")
    if not facts["systemd"]:
        yield error("systemd does not run as the init system", "/run/systemd/system", "k3s is run as a systemd unit")
    if not facts["root"]:
        yield error("the tasks do not run as root", "effective user ID", "set become: true for this host")
    if not facts["overlay"]:
        what = "the kernel has not loaded overlayfs, which containers need"
        yield warning(what, "/proc/filesystems", "modprobe overlay; if that fails, install a kernel that has it")


def _cgroups(facts: Result, _wanted: Variables) -> Iterable[Finding]:
    cgroup = facts["cgroup"]
    missing = [name for name in CONTROLLERS if name not in cgroup["controllers"]]
    if not missing:
        return
    where = "/sys/fs/cgroup/cgroup.controllers" if cgroup["version"] == 2 else "/proc/cgroups"
    yield error(f"these cgroup controllers are off: {', '.join(missing)}", where, _cgroup_fix(facts, missing))


def _cgroup_version(facts: Result, wanted: Variables) -> Iterable[Finding]:
    """k3s 1.35 is the next upgrade of a robot that has 1.34, so it is said before."""
    if not facts["cgroup"]["refused"]:
        return
    coming = version(wanted["k3s_version"])
    refused = coming is not None and coming.minor >= CGROUP_V2_FROM
    which = wanted["k3s_version"] if refused else "from 1.35 on"
    fix = "boot with systemd.unified_cgroup_hierarchy=1 on the kernel's command line, or allow v1: role k3s, README"
    yield (error if refused else warning)(
        f"it has cgroup v1, with which k3s {which} does not start", "/sys/fs/cgroup", fix
    )


def _cgroup_fix(facts: Result, missing: list[str]) -> str:
    """On a Raspberry Pi the firmware switches the memory controller off unless the command line asks for it."""
    cgroup = facts["cgroup"]
    if facts["board"].startswith("Raspberry Pi"):
        file = cgroup["cmdline_file"] or "/boot/firmware/cmdline.txt"
        asked = [option for option in PI_OPTIONS.split() if option not in cgroup["cmdline"].split()]
        options = " ".join(asked or PI_OPTIONS.split())
        return f"on this {facts['board']}: sed -i '1 s/$/ {options}/' {file}, then reboot"
    disabled = [word for word in cgroup["cmdline"].split() if word.startswith("cgroup_disable=")]
    if disabled:
        return f"take {' '.join(disabled)} off the kernel's command line and reboot"
    return f"boot a kernel that has the controllers {', '.join(missing)}"


def _memory(facts: Result, wanted: Variables) -> Iterable[Finding]:
    has, role = facts["memory_mb"], wanted["role"]
    limits = wanted["preflight_memory_mb"][role]
    if has < limits["minimum"]:
        fix = "use a host with more memory" + (", or robot_mode: agent" if role == "server" else "")
        yield error(f"{has} MiB of memory, a k3s {role} needs {limits['minimum']}", "/proc/meminfo", fix)
    elif has < limits["recommended"]:
        what = f"{has} MiB of memory leave little beside a k3s {role}; {limits['recommended']} are better"
        yield warning(what, "/proc/meminfo", "keep the apps' requests small")


def _disk(facts: Result, wanted: Variables) -> Iterable[Finding]:
    disk, limits, percents = facts["disk"], wanted["preflight_disk_mb"], wanted["preflight_disk_percent"]
    free, path, fix = disk["free_mb"], disk["path"], "free space, or mount a larger file system there"
    percent = 100 * free / max(disk["total_mb"], 1)
    has = f"{free} MiB free for {path}"
    of_all = f"{has}, {percent:.1f} % of {disk['total_mb']} MiB"
    if free < limits["minimum"]:
        yield error(f"{has}, at least {limits['minimum']} are needed", path, fix)
    elif percent < percents["minimum"]:
        why = f"k3s evicts pods, ROS apps at work, too, where less than {EVICTION_FREE_PERCENT} % are free"
        yield error(f"{of_all}: {why}; at least {percents['minimum']} % are needed", path, fix)
    elif free < limits["recommended"]:
        yield warning(f"{has}; images fill that fast, {limits['recommended']} are better", path, fix)
    elif percent < percents["recommended"]:
        why = f"k3s deletes images that no container uses where more than {IMAGE_GC_USED_PERCENT} % are used, "
        why += "also those of the next and of the last version"
        yield warning(f"{of_all}: {why}; {percents['recommended']} % are better", path, fix)
    if disk["free_inodes"] is not None and disk["free_inodes"] < 20000:
        what = f"{disk['free_inodes']} inodes free for {path}; one ROS image takes about 20,000"
        yield warning(what, path, "make the file system with more inodes")
    if disk["type"] in UNFIT_FILESYSTEMS:
        what = f"{path} lies on {disk['type']}, on which containers' file systems cannot be laid"
        yield error(what, path, "mount an ext4, xfs or btrfs file system there")


def _clock(facts: Result, wanted: Variables) -> Iterable[Finding]:
    """Only what is beyond the measurement's own uncertainty counts."""
    clock, limits = facts["clock"], wanted["preflight_clock_offset"]
    certain = abs(clock["offset"]) - clock["uncertainty"]
    if certain <= limits["recommended"]:
        return
    way = "ahead of" if clock["offset"] > 0 else "behind"
    what = f"the clock is {abs(clock['offset']):.2f} s (± {clock['uncertainty']:.2f} s) {way} the control node's"
    fix = "let a time service run (systemd-timesyncd or chrony); a board without a battery needs one at every boot"
    yield (error if certain > limits["maximum"] else warning)(what, "clock", fix)


def _network(facts: Result, _wanted: Variables) -> Iterable[Finding]:
    if not facts["routes"]:
        fix = "add one, be it to a dummy interface: ip route add default via GATEWAY"
        yield error("there is no default route, without which k3s does not start", "/proc/net/route", fix)
    elif route_mtu(facts) < MINIMUM_MTU:
        what, where = f"the MTU is {route_mtu(facts)}", f"interface {facts['routes'][0]['interface']}"
        yield error(f"{what}, at least {MINIMUM_MTU} are needed", where, "raise it: ip link set dev INTERFACE mtu SIZE")


def _pods_network(facts: Result, wanted: Variables) -> Iterable[Finding]:
    """What may keep the host's pods from those of others, though its Node is Ready. Warnings only: what a firewall lets
    through is not seen from here."""
    network, role = facts["network"], wanted["role"]
    for firewall in network["firewalls"]:
        what = f"{firewall} is on; a k3s {role} needs {PORTS[role]}, and its pods and services {NETWORKS}"
        yield warning(what, "/etc/ufw/ufw.conf" if firewall == "ufw" else "/proc", ALLOW[firewall])
    selinux = network["selinux"]
    if selinux["mode"] == "enforcing" and not selinux["policy"]:
        what = "SELinux is enforcing, and k3s's policy is not there: containers may be denied their files"
        fix = "install the packages container-selinux and k3s-selinux, and set k3s_config: {selinux: true}"
        yield warning(what, "/sys/fs/selinux/enforce", fix)
    for module in network["lacking"]:
        fix = "on Ubuntu for the Raspberry Pi: apt install linux-modules-extra-raspi; elsewhere a kernel that has it"
        fix += ", or k3s_config: {flannel-backend: host-gw} on the servers" if module == "vxlan" else ""
        yield warning(f"the kernel has no module {module}: {WITHOUT[module]}", f"/lib/modules/{facts['kernel']}", fix)
    interfaces = list(dict.fromkeys(route["interface"] for route in facts["routes"] if route["family"] == 4))
    if len(interfaces) > 1 and not wanted["interface"]:
        by = f"pods go by {interfaces[0]}, or by another one when k3s starts while that is down"
        what = f"there are default routes by {' and '.join(interfaces)}: {by}"
        fix = "say by which one the robot reaches the others: k3s_config: {flannel-iface: NAME}, and k3s_node_ip"
        yield warning(what, "/proc/net/route", fix)


def _ports(facts: Result, _wanted: Variables) -> Iterable[Finding]:
    ours = bool(facts["k3s"]["units"])
    for listener in facts["listening"]:
        # A socket without a process is the kernel's (VXLAN), which k3s leaves behind while it is installed.
        if listener["k3s"] or (ours and not listener["process"]):
            continue
        port, by = f"{listener['port']}/{listener['protocol']}", listener["process"] or "an unnamed process"
        fix = "stop that service, or move it to another port"
        yield error(f"port {port} is taken by {by}", f"/proc/net/{listener['protocol']}", fix)


def _reachable(facts: Result, wanted: Variables) -> Iterable[Finding]:
    """A node that has joined runs on without its server, so it is not stopped for that; a new one cannot join.

    A new agent takes whichever server answers. A new server has to reach all of them.
    """
    joined = facts["k3s"]["agent_data"]
    one_takes = wanted["role"] == "agent" and any(target["outcome"] == "open" for target in facts["reach"])
    for target in facts["reach"]:
        if target["outcome"] in ANSWERS:
            continue
        what = f"{target['host']} port {target['port']} does not answer ({target['outcome']})"
        fix = "check the address, routes and firewalls between this host and that one"
        yield (warning if joined or one_takes else error)(what, "TCP connection", fix)


def _name(facts: Result, wanted: Variables) -> Iterable[Finding]:
    name = facts["hostname"]
    if not all(LABEL.match(part) for part in name.split(".")) or len(name) > 253:
        fix = "use lower-case letters, digits and hyphens: hostnamectl set-hostname NAME"
        yield error(f"the host name {name!r} is not valid in Kubernetes", "uname -n", fix)
    elif name in ("localhost", "localhost.localdomain"):
        yield error("the host is named localhost", "uname -n", "hostnamectl set-hostname NAME")
    if wanted["node_name"] and not LABEL.match(wanted["node_name"]):
        what = f"the node name {wanted['node_name']!r} is not valid in Kubernetes"
        yield error(what, "inventory", "use lower-case letters, digits and hyphens, at most 63")


def _leftovers(facts: Result, wanted: Variables) -> Iterable[Finding]:
    old, role = facts["k3s"], wanted["role"]
    other = "k3s-agent.service" if role == "server" else "k3s.service"
    reset = "run the playbook reset.yml for this host"
    if other in old["units"]:
        yield error(f"{other} is installed, but this host is to be a k3s {role}", "/etc/systemd/system", reset)
    elif role == "agent" and old["server_data"]:
        yield error("the host holds a k3s server's datastore", "/var/lib/rancher/k3s/server/db", reset)
    if role == "server" and old["server_data"] and not old["config"]:
        what = "the host holds a k3s server's datastore without its configuration"
        fix = f"restore /etc/rancher/k3s with its token, or {reset}"
        yield error(what, "/var/lib/rancher/k3s/server/db", fix)
    urls = [f"https://{server}:{API}" for server in wanted["others"]]
    if urls and old["server_url"] and old["server_url"] not in urls:
        what = f"the host belongs to the cluster of {old['server_url']}, not to that of {', '.join(urls)}"
        yield (error if old["agent_data"] else warning)(what, "/etc/rancher/k3s/config.yaml", reset)
    for unit in old["foreign_units"]:
        yield warning(f"{unit} was not written by this collection and will be replaced", "/etc/systemd/system", reset)
    if old["node_password"] and not old["config"]:
        what = "a node password of an earlier cluster is left; a cluster that knows this node by another one rejects it"
        fix = f"if the node does not join: {reset}, or delete the secret NODE.node-password.k3s in kube-system"
        yield warning(what, "/etc/rancher/node/password", fix)


CHECKS: tuple[Callable[[Result, Variables], Iterable[Finding]], ...] = (
    _platform, _cgroups, _cgroup_version, _memory, _disk, _clock, _network, _pods_network, _ports, _reachable, _name,
    _leftovers,
)  # fmt: skip


def judge(fleet: Mapping[str, Result], host: str, wanted: Variables) -> list[Finding]:
    """What is wrong with one of these hosts, the errors first. `fleet` is host -> its facts.

    `wanted` are the role's variables, role, node_name, k3s_version and interface of the host, and the addresses of the
    `others`, the cluster's other servers.
    """
    alone = [finding for check in CHECKS for finding in check(fleet[host], wanted)]
    return sorted([*alone, *fleet_findings(host, fleet)], key=lambda finding: finding.severity != ERROR)


def report(host: str, found: list[Finding]) -> str:
    """The host's findings as text: one line each."""
    if not found:
        return f"{host}: ready for k3s, nothing to remark"
    counts = {word: sum(finding.severity == word for finding in found) for word in (ERROR, WARNING)}
    head = ", ".join(f"{count} {word}{'' if count == 1 else 's'}" for word, count in counts.items())
    told = [f"{f.severity}: {f.what} (seen in {f.where}). Fix: {f.fix}" for f in found]
    lines = [f"  {printable(' '.join(line.split()))}" for line in told]  # with words of the host's own
    return "\n".join([f"{host}: {head}", *lines])
