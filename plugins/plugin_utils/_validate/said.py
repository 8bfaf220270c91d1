# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What an operator has written, whatever is wrong with it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from .._model.topology import edge_servers, members

Said = Mapping[str, Any]  # a mapping of the inventory: a host's variables, an app, an archive
Hosts = Mapping[str, Said]  # variables by host


class Inventory(NamedTuple):
    """Groups, hosts with their variables, and the modes of the robots."""

    groups: Said
    hosts: Hosts
    modes: Mapping[str, str]

    def variable(self, host: str, name: str) -> Any:
        """What is said of a host; None where nothing is."""
        return self.hosts.get(host, {}).get(name)

    @property
    def edge_cluster(self) -> list[str]:
        """The hosts of the shared cluster, servers and agents."""
        return [*members(self.groups, "edge"), *(robot for robot, mode in self.modes.items() if mode == "agent")]

    @property
    def clusters(self) -> list[str]:
        """Of each cluster the host that carries its variables: its first server."""
        alone = (robot for robot, mode in self.modes.items() if mode == "standalone")
        return [*edge_servers(self.groups)[:1], *alone]
