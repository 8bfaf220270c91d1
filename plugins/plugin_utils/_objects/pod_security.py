# SPDX-License-Identifier: GPL-3.0-or-later
"""What a level of Kubernetes' Pod Security Standards (kubernetes.io, of 1.33) refuses of a pod. Pure.

The API server refuses such a pod when its Deployment makes it, which nobody would see before the rollout.
"""

from __future__ import annotations

from collections.abc import Iterator

from ...module_utils._step.objects import Object

RESTRICTED = "restricted"
CLOSED = ("baseline", RESTRICTED)
CAPABILITIES = (
    "AUDIT_WRITE", "CHOWN", "DAC_OVERRIDE", "FOWNER", "FSETID", "KILL", "MKNOD", "NET_BIND_SERVICE", "SETFCAP",
    "SETGID", "SETPCAP", "SETUID", "SYS_CHROOT",
)  # fmt: skip
PROFILES = ("RuntimeDefault", "Localhost")
SELINUX = (None, "", "container_t", "container_init_t", "container_kvm_t", "container_engine_t")
VOLUMES = {"configMap", "csi", "downwardAPI", "emptyDir", "ephemeral", "persistentVolumeClaim", "projected", "secret"}
SYSCTLS = (
    "kernel.shm_rmid_forced", "net.ipv4.ip_local_port_range", "net.ipv4.ip_unprivileged_port_start",
    "net.ipv4.tcp_syncookies", "net.ipv4.ping_group_range", "net.ipv4.ip_local_reserved_ports",
    "net.ipv4.tcp_keepalive_time", "net.ipv4.tcp_fin_timeout", "net.ipv4.tcp_keepalive_intvl",
    "net.ipv4.tcp_keepalive_probes",
)  # fmt: skip


def refused(pod: Object, level: str) -> list[str]:
    """Of the spec of a pod, each by its field; nothing where the level is none of CLOSED."""
    if level not in CLOSED:
        return []
    context = pod.get("securityContext") or {}
    found = [key for key in ("hostNetwork", "hostPID", "hostIPC") if pod.get(key)]
    for one in pod.get("volumes") or ():
        kinds = {*one} - {"name"}
        if "hostPath" in kinds or (level == RESTRICTED and kinds - VOLUMES):
            found.append(f"{', '.join(sorted(kinds))} (volume {one.get('name')})")
    found += [f"sysctl {one.get('name')}" for one in context.get("sysctls") or () if one.get("name") not in SYSCTLS]
    for one in [*(pod.get("initContainers") or ()), *pod["containers"]]:
        found += [f"{wrong} (container {one.get('name')})" for wrong in _of_container(one, context, level)]
    return found


def _of_container(container: Object, of_pod: Object, level: str) -> Iterator[str]:
    own = container.get("securityContext") or {}
    said: Object = {**of_pod, **own}  # what both may say, the container says
    kinds = {key: (said.get(key) or {}).get("type") for key in ("appArmorProfile", "seLinuxOptions", "seccompProfile")}
    selinux, capabilities = said.get("seLinuxOptions") or {}, own.get("capabilities") or {}
    free = ("NET_BIND_SERVICE",) if level == RESTRICTED else CAPABILITIES
    yield from (f"capability {one}" for one in capabilities.get("add") or () if one not in free)
    wrong = {
        "privileged": own.get("privileged"),
        "hostPort": any(port.get("hostPort") for port in container.get("ports") or ()),
        "procMount": own.get("procMount") not in (None, "Default"),
        "appArmorProfile": kinds["appArmorProfile"] not in (None, *PROFILES),
        "seLinuxOptions": kinds["seLinuxOptions"] not in SELINUX or selinux.get("user") or selinux.get("role"),
        "seccompProfile": kinds["seccompProfile"] not in (None, *PROFILES),
    }
    if level == RESTRICTED:
        wrong |= {
            "allowPrivilegeEscalation": own.get("allowPrivilegeEscalation") is not False,
            "no runAsNonRoot": said.get("runAsNonRoot") is not True,
            "runAsUser 0": said.get("runAsUser") == 0,
            "no seccompProfile": kinds["seccompProfile"] is None,
            "no capabilities.drop ALL": "ALL" not in (capabilities.get("drop") or ()),
        }
    yield from (field for field, is_wrong in wrong.items() if is_wrong)
