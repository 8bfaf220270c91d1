# SPDX-License-Identifier: GPL-3.0-or-later
"""What Ansible is told about a lab."""

from __future__ import annotations

import shlex
from pathlib import Path

import pytest
import yaml
from lablib.errors import LabError
from lablib.inventory import host_variables, hosts_file, inventory
from lablib.keys import Keys
from lablib.state import Host, LabState

STATE = LabState(
    "demo",
    "10.70.1.0/24",
    (
        Host("edge1", "edge", "10.70.1.11"),
        Host("robot1", "robots", "10.70.1.12"),
        Host("robot2", "robots", "10.70.1.13"),
    ),
)
KEYS = Keys(Path("/work dir/50%/.lab/demo/ssh"))


def test_a_file_for_an_inventory_of_one_s_own_says_the_same() -> None:
    listing = inventory(STATE, KEYS, "/x/.lab/demo", {"image_archives": ["/cache/a.tar"]})
    found = yaml.safe_load(hosts_file(listing))["all"]
    variables = listing["_meta"]["hostvars"]
    assert found["vars"] == listing["all"]["vars"]
    assert found["children"] == {
        group: {"hosts": {name: variables[name] for name in listing[group]["hosts"]}} for group in ("edge", "robots")
    }


def test_host_keys_are_checked_whatever_the_path() -> None:
    variables = host_variables(STATE.hosts[0], KEYS)
    options = shlex.split(variables["ansible_ssh_common_args"])
    assert "StrictHostKeyChecking=yes" in options
    # ssh splits an option at spaces and expands %: quoted against the one, doubled against the other
    assert 'UserKnownHostsFile="/work dir/50%%/.lab/demo/ssh/known_hosts"' in options
    assert variables["ansible_host"] == "10.70.1.11"
    assert variables["ansible_user"] == "root"
    assert variables["ansible_python_interpreter"] == "/usr/bin/python3"


def test_an_unknown_host_is_an_error_that_names_the_known_ones() -> None:
    with pytest.raises(LabError, match=r"no host robot9(.|\n)*edge1, robot1, robot2"):
        STATE.host("robot9")
