# SPDX-License-Identifier: GPL-3.0-or-later
"""The lab as an Ansible inventory: pure functions of its state."""

from __future__ import annotations

import json
import shlex
from collections.abc import Mapping
from typing import Any

from .keys import Keys
from .names import GROUPS
from .state import Host, LabState

Json = dict[str, Any]


def host_variables(host: Host, keys: Keys) -> Json:
    return {
        "ansible_host": host.address,
        "ansible_user": "root",
        "ansible_ssh_private_key_file": str(keys.private_key).replace("%", "%%"),
        "ansible_ssh_common_args": shlex.join(keys.options()),
        "ansible_python_interpreter": "/usr/bin/python3",
    }


def inventory(state: LabState, keys: Keys, directory: str, artifacts: Mapping[str, Any]) -> Json:
    """What `--list` prints. `lab_*` variables say where the lab's artifacts and state are."""
    groups: Json = {group: {"hosts": [host.name for host in state.hosts if host.group == group]} for group in GROUPS}
    return {
        **groups,
        "all": {
            "children": ["ungrouped", *GROUPS],
            "vars": {
                "lab_name": state.name,
                "lab_dir": directory,
                "lab_subnet": state.subnet,
                **{f"lab_{name}": value for name, value in artifacts.items()},
            },
        },
        "_meta": {"hostvars": {host.name: host_variables(host, keys) for host in state.hosts}},
    }


def hosts_file(listing: Mapping[str, Any]) -> str:
    """The same as the hosts.yml of an inventory; what JSON writes of a value is YAML, too."""
    lines = ["---", "all:", "  children:"]
    for group in GROUPS:
        lines += [f"    {group}:", "      hosts:"]
        for name in listing[group]["hosts"]:
            lines += [f"        {name}:", *_mapping(listing["_meta"]["hostvars"][name], 10)]
    return "\n".join([*lines, "  vars:", *_mapping(listing["all"]["vars"], 4)]) + "\n"


def _mapping(values: Mapping[str, Any], columns: int) -> list[str]:
    return [f"{' ' * columns}{name}: {json.dumps(value)}" for name, value in values.items()]
