# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""A command on another host than the task's, as `delegate_to` has it: its own connection, also outside of --limit."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .._upstream import ansible_core


def run_on(plugin: Any, known: Mapping[str, Any], host: str, command: str) -> dict[str, Any]:
    """Run a command as root on a host; the result of ansible.builtin.raw, or one that says `unreachable`.

    Neither the command's output nor its failure is shown, at no verbosity. Ansible's own executor does it: whatever an
    inventory says about connections, keys and privileges holds.
    """
    return ansible_core.run_task(
        plugin,
        known,
        {
            "ansible.builtin.raw": command,
            "delegate_to": host,
            "become": True,
            "no_log": True,
            "check_mode": False,
        },
    )
