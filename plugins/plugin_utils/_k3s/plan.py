# SPDX-License-Identifier: GPL-3.0-or-later
"""What is to be done about k3s on a host, and what forbids it: what k3s_facts found against what should be. Pure.

Kubernetes takes one minor version after the other and no way back: the datastore is written in the newer one's form. A
kubelet must not be newer than the API that it talks to.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator, Sequence
from dataclasses import replace

from ...module_utils._common.documents import Result, Variables
from ...module_utils._common.poll import WAIT
from ...module_utils._host.k3s import BINARY, CONFIG_DIR, DATA_DIR
from .._model.machines import CGROUP_V2_FROM, MACHINES
from .._model.machines import version as parsed
from .wanted import Artifacts, HostFile, Wanted, enrolled

# states of a unit out of which only a restart brings something new in
UP = ("active", "activating", "reloading", "deactivating")
BEHIND = "behind"  # verdict on a server's token: another server of its cluster has a newer one
# verdicts with which a token must be written; that of the servers is the datastore's key
WRITE = {"token": ("absent", "restore", BEHIND), "agent-token": ("absent", "restore", "differs")}
ARCHIVE = re.compile(r"k3s-airgap-images-.*-[0-9a-f]{12}[.]tar")


def file_changes(wanted: Sequence[HostFile], found: Result) -> dict[str, list[str]]:
    """Paths of the files to `write` and to `remove` (no content).

    `found` is what k3s_facts saw. Comparing digests here spares a host on which nothing changed a task per file.
    """

    def right(file: HostFile) -> bool:
        there, digest = found[file.path], hashlib.sha256(file.content.encode()).hexdigest()
        return bool((there["sha256"], there["mode"]) == (digest, file.mode))

    return {
        "write": [file.path for file in wanted if file.content and not right(file)],
        "remove": [file.path for file in wanted if not file.content and found[file.path]["exists"]],
    }


def plan(now: Result, wanted: Wanted, source: Artifacts, version: str, kubeconfig_right: bool) -> Result:
    """Everything that is to be done, and whether there is anything (`any`), but a wait (`undone`). No secret is in it.

    `version` is the binary's where its checksum is not known beforehand; `kubeconfig_right` is whether the one on the
    control node is. `unsure`: it would be changed, is up and has a cluster's data, but did not serve in this one look;
    `down`: it has such data and is not up.
    """
    there = now["files"][BINARY]
    right = there["sha256"] == source.sha256 if source.sha256 else now["version"] == version
    binary = not (right and int(there["mode"] or "0", 8) & 0o100)  # a file that is only half put there may not run
    verdicts = {"token": now["tokens"]["server"], "agent-token": now["tokens"]["agent"]}
    # a host that has not joined takes all anew: those it has may be an earlier cluster's, or have ended
    joins = wanted.anew or (not wanted.init and (not now["data"] or now["lapsed"]))
    tokens = [name for name in wanted.tokens if joins or verdicts[name] in WRITE[name]]
    changes = file_changes(wanted.files, now["files"])
    changed = bool(binary or tokens or any(changes.values()) or now["stale"] or wanted.rotate)
    up = now["service"]["active"] in UP
    start = changed or not up or not now["service"]["enabled"]
    unproven = bool(now["change"]["unproven"])
    works = bool(up and now["ready"] and now["data"])
    work: Result = {
        "binary": binary,
        "archive": bool(source.archive_name) and now["images"].get(source.archive_name) != source.archive_size,
        "tokens": tokens,
        "rotate": wanted.rotate,
        **changes,
        "beside": file_changes(wanted.beside, now["files"])["write"],
        "start": start,
        "wait": start or unproven or not now["ready"],
        # what serves is changed with care, and what nobody has proven is proven or taken back
        "guarded": (works and changed) or unproven,
        "unproven": unproven,
        # what was cut off may have left it stopped
        "restart": changed or (unproven and not up),
        "kubeconfig": bool(wanted.kubeconfig) and (start or not kubeconfig_right),
    }
    undone = any(value for name, value in work.items() if name != "wait")
    if wanted.anew or wanted.rotate:  # asked for at each look, so that by this nobody sees whether it was done
        undone = plan(now, replace(wanted, anew=False, rotate=""), source, version, kubeconfig_right)["undone"]
    return {
        **work,
        "works": works,
        # one that is not let in any more will never serve
        "unsure": bool(up and now["data"] and not now["ready"] and (changed or unproven) and not joins),
        "down": bool(now["data"] and not up),
        "any": any(work.values()),
        "undone": undone,
        # a unit that is up and only not enabled is not restarted for that
        "state": "restarted" if up and changed else "started",
    }


def old_archives(now: Result, source: Artifacts) -> list[str]:
    """Archives of images of earlier versions."""
    return sorted(name for name in now["images"] if ARCHIVE.match(name) and name != source.archive_name)


# --- what forbids it --------------------------------------------------------------------------------------------------


def refusals(now: Result, variables: Variables, host: str) -> Iterator[str]:
    """Sentences; `now` is what k3s_facts found."""
    role, servers, tokens = variables["k3s_role"], variables["k3s_server_hosts"], now["tokens"]
    cluster = f"the cluster {variables['k3s_cluster']} runs with"
    if tokens["server"] == "differs" and not variables["k3s_token"]:
        yield (
            f"The token in {CONFIG_DIR}/token is not the one that {cluster}. Where its rotation has ended early, "
            "rosops.fleet.rotate with rotate=token goes on with it."
        )
    elif tokens["server"] == "differs":
        yield (
            f"k3s_token is not the token that {cluster}: with another one its servers do not start, for they keep the "
            "cluster's own keys in the datastore under it. Take k3s_token out of the inventory to keep it."
        )
    if "lost" in tokens.values():
        yield (
            "The host holds a cluster's datastore (/var/lib/rancher/k3s/server), but not that cluster's tokens in "
            "/etc/rancher/k3s. Set k3s_token and k3s_agent_token to the cluster's, or run reset.yml for this host."
        )
    if now["foreign"] and not enrolled(variables, host):
        yield (
            f"{' and '.join(now['foreign'])} is of another cluster than the one that this host has joined. Where that "
            f"one is gone for good, -e k3s_enrol={host} has the host join this one; what works on it is ended, unasked."
        )
    if now["other_service"]:
        other = "agent" if role == "server" else "server"
        yield f"It is a k3s {other} and is to become a {role}. Run reset.yml for this host first."
    if (host in servers) != (role == "server"):
        yield f"k3s_role is {role}, but k3s_server_hosts is {', '.join(servers)}."
    # each run would take the host for a new one, and start it again without asking who works there
    if variables["k3s_config"].get("data-dir") not in (None, DATA_DIR):
        yield f"k3s_config has a data-dir. Leave it out, and mount the disk at {DATA_DIR}, or make that a link to it."
    if variables["k3s_install_source"] == "airgap" and not variables["k3s_airgap_dir"]:
        yield "The install source airgap needs k3s_airgap_dir."
    # what an airgap directory holds is known when it is on the host
    wanted = variables["k3s_version"] if variables["k3s_install_source"] == "release" else ""
    back_to = now["change"]["version"] if now["change"]["unproven"] else ""
    if step := refusal(now["version"], wanted, back_to=back_to, cgroup_refused=now["cgroup_refused"]):
        yield step
    if now["machine"] not in MACHINES:
        yield f"There is no k3s for the architecture {now['machine']}."


def unheard_refusal(seen: Result, plan: Result, variables: Variables) -> str:
    """Why a k3s that was waited for is left as it is, or nothing.

    `seen` is what k3s_ready found. A unit that keeps ending is down, and what nobody has proven is to be taken back.
    """
    if seen["verdict"] != WAIT or plan["unproven"] or variables["update_on_busy"] == "force":
        return ""
    return (
        f"Its k3s is up and does not serve: {seen['observed']}, for {seen['elapsed']:.0f} s (k3s_start_timeout). What "
        "it has started may well be at work, and cannot be asked. Mend it and run again, or stop it on the host "
        "(systemctl stop) where nothing is at work; update_on_busy=force changes it as it is."
    )


def refusal(
    installed: str, wanted: str, servers: Sequence[str] = (), back_to: str = "", cgroup_refused: bool = False
) -> str:
    """Why a host does not go from one version to the other; empty where it may.

    `installed` is empty where there is no k3s, `wanted` where it is not known beforehand. `servers` are the versions of
    the servers that the host is an agent of. `back_to` is the version that an unproven change replaced: it may always
    come back. `cgroup_refused` is what k3s_facts says of the host.
    """
    old, new = parsed(installed), parsed(wanted)
    if new is None:
        return ""
    if old and wanted != back_to and old.newer_than(new):
        return (
            f"k3s {wanted} is older than {installed}, which runs there: its datastore and Node are of the newer one. "
            f"Set k3s_version to {installed} or newer (k3s_airgap_dir likewise); the way back to an older one is a "
            "snapshot, see the role k3s."
        )
    if old and wanted != back_to and new.minor[0] == old.minor[0] and new.minor[1] - old.minor[1] > 1:
        return (
            f"From k3s {installed} to {wanted} a minor version is skipped, which Kubernetes does not support. "
            f"Go to a version v{old.minor[0]}.{old.minor[1] + 1}.x first."
        )
    if older := [text for text in servers if (known := parsed(text)) and new.newer_than(known)]:
        return (
            f"k3s {wanted} is newer than its cluster's servers ({', '.join(dict.fromkeys(older))}); an agent must not "
            "be. Bring the servers to that version first: rosops.fleet.site without --limit."
        )
    # what runs there with cgroup v1 has somebody who saw to that
    if cgroup_refused and new.minor >= CGROUP_V2_FROM and not (old and old.minor >= CGROUP_V2_FROM):
        return (
            f"k3s {wanted} does not start on this host, which has cgroup v1: from 1.35 on the kubelet wants v2. Boot "
            "it with systemd.unified_cgroup_hierarchy=1 on the kernel's command line, or allow v1 (the role k3s says "
            "how)."
        )
    return ""


def restarts_pods(installed: str, wanted: str) -> bool:
    """Whether the kubelet of another minor version may start all containers again, as that of 1.31 did."""
    old, new = parsed(installed), parsed(wanted)
    return old is not None and new is not None and old.minor != new.minor
