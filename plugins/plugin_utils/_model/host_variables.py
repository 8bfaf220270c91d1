# SPDX-License-Identifier: GPL-3.0-or-later
"""A host's variables as its own tasks see them, seen from elsewhere."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from ansible.vars.hostvars import HostVars, HostVarsVars

from ...module_utils._common.documents import Variables
from .._upstream import ansible_core


class HostVariables(Mapping[str, Variables]):
    """`hostvars`, but a host's value may refer to `hostvars` in its turn: an address of the hub, a master elsewhere.

    Ansible's own leaves `hostvars` out where it templates another host's variables (HostVars.raw_get of
    ansible/vars/hostvars.py), although the same value is good in that host's own tasks. A plain mapping stays as it is.
    """

    def __init__(self, hostvars: Mapping[str, Variables]) -> None:
        self._hostvars = hostvars

    def __getitem__(self, host: str) -> Variables:
        if host not in self._hostvars:
            raise KeyError(host)
        if not isinstance(self._hostvars, HostVars):
            return self._hostvars[host]
        variables = {**self._hostvars.raw_get(host), "hostvars": self._hostvars}
        found: Variables = HostVarsVars(variables, ansible_core.loader_of(self._hostvars), host)
        return found

    def __iter__(self) -> Iterator[str]:
        return iter(self._hostvars)

    def __len__(self) -> int:
        return len(self._hostvars)
