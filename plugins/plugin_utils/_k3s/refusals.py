# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What cannot be mended on a host, found before anything is changed and all at once. Pure."""

from __future__ import annotations

from collections.abc import Iterator

from ...module_utils._common.documents import Result, Variables
from ...module_utils._common.poll import WAIT
from .._model.machines import MACHINES
from .upgrade import refusal


def refusals(now: Result, variables: Variables, host: str) -> Iterator[str]:
    """Sentences; `now` is what k3s_info found."""
    role, servers, tokens = variables["k3s_role"], variables["k3s_server_hosts"], now["tokens"]
    cluster = f"the cluster {variables['k3s_cluster']} runs with"
    if tokens["server"] == "differs":
        yield (
            f"k3s_token is not the token that {cluster}: with another one its servers do not start, for they keep the "
            "cluster's own keys in the datastore under it. Take k3s_token out of the inventory to keep it."
        )
    if tokens["agent"] == "differs":
        yield (
            f"k3s_agent_token is not the agents' token that {cluster}; agents that are off now would be locked out. "
            "Take k3s_agent_token out of the inventory to keep it."
        )
    if "lost" in tokens.values():
        yield (
            "The host holds a cluster's datastore (/var/lib/rancher/k3s/server), but not that cluster's tokens in "
            "/etc/rancher/k3s. Set k3s_token and k3s_agent_token to the cluster's, or run reset.yml for this host."
        )
    if now["other_service"]:
        other = "agent" if role == "server" else "server"
        yield f"It is a k3s {other} and is to become a {role}. Run reset.yml for this host first."
    if (host in servers) != (role == "server"):
        yield f"k3s_role is {role}, but k3s_server_hosts is {', '.join(servers)}."
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
