# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a host is, from the inventory alone: one that is off has its address, too."""

from __future__ import annotations

from collections.abc import Mapping

from ...module_utils._common.documents import Variables
from ...module_utils._common.errors import SpecError


def address(host: str, hostvars: Mapping[str, Variables]) -> str:
    """The host's address as it stands in a URL, an IPv6 one in brackets.

    `k3s_node_ip` comes before `ansible_host`, and that before the host's name.
    """
    if host not in hostvars:
        raise SpecError(f"{host} is no host of the inventory")
    known = hostvars[host]
    text = str(known.get("k3s_node_ip") or known.get("ansible_host") or host).split(",", maxsplit=1)[0].strip()
    return f"[{text}]" if ":" in text else text
