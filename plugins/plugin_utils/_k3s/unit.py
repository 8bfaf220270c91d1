# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The texts of k3s's systemd unit and of the unit's environment."""

from __future__ import annotations

import json
from collections.abc import Sequence

from ...module_utils._common.documents import Variables
from ...module_utils._host.k3s import BINARY, STARTED_WITH

HEADER = "# Written by Ansible (rosops.fleet.k3s); changes are overwritten.\n"
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
    return HEADER + UNIT.format(
        role=role,
        started_with=" ".join(started_with),
        record=STARTED_WITH.format(service=service),
        binary=BINARY,
        limits="\n".join(f"{name}={value}" for name, value in limits.items() if value != ""),
    )


def environment_text(environment: Variables) -> str:
    """The unit's environment; empty if there is none. systemd reads a value as C does, which JSON's quotes are."""
    lines = (f"{name}={json.dumps(str(environment[name]))}\n" for name in sorted(environment, key=str.lower))
    return HEADER + "".join(lines) if environment else ""
