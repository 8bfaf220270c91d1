# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What is wrong, as people read it: once for all hosts of a group, and apps by their names. Pure."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

from .._model.finding import Problem
from .said import Hosts

SHOWN = 4  # hosts of a line
_APP = re.compile(r"ros_apps\[(\d+)\]")


class Folded(NamedTuple):
    """A problem as it is of the first of its hosts, and the name of its app; both may be none's."""

    problem: Problem
    hosts: tuple[str, ...]
    app: str

    def as_dict(self) -> dict[str, Any]:
        """Shape of an item of the validation's `errors`."""
        return {**self.problem.as_dict(), "hosts": list(self.hosts), "app": self.app}

    def line(self) -> str:
        """`hosts.robot1.ros_apps[2].placement: is 'cloud'; allowed: local or remote (app lidar; so on robot2, too)`."""
        others = self.hosts[1:]
        more = f" and {len(others) - SHOWN} more" if len(others) > SHOWN else ""
        so = f"so on {', '.join(others[:SHOWN])}{more}, too" if others else ""
        beside = "; ".join(filter(None, (f"app {self.app}" if self.app else "", so)))
        return self.problem.line() + (f" ({beside})" if beside else "")


def folded(problems: Iterable[Problem], hosts: Hosts) -> list[Folded]:
    """In order of appearance; `hosts` are the variables as they were written."""
    found: dict[tuple[str, ...], list[tuple[str, Problem]]] = {}
    for problem in problems:
        host, inner = _parts(problem.path, hosts)
        # whatever it says of another place of the same host it says of each
        same = (
            inner,
            *(text.replace(f"hosts.{host}.", "") if host else text for text in problem[1:]),
            _app(host, inner, hosts),
        )
        found.setdefault(same, []).append((host, problem))
    return [
        Folded(group[0][1], tuple(dict.fromkeys(host for host, _problem in group if host)), same[-1])
        for same, group in found.items()
    ]


def _parts(path: str, hosts: Hosts) -> tuple[str, str]:
    """The host of a path and the rest of it; a host's name may have dots."""
    words = path.split(".")
    for end in range(2, len(words) if words[0] == "hosts" else 0):
        host = ".".join(words[1:end])
        if host in hosts:
            return host, ".".join(words[end:])
    return "", path


def _app(host: str, inner: str, hosts: Hosts) -> str:
    match = _APP.match(inner)
    apps = hosts[host].get("ros_apps") if host and match else None
    if match is None or not isinstance(apps, list) or int(match[1]) >= len(apps):
        return ""
    app = apps[int(match[1])]
    return str(app.get("name") or "") if isinstance(app, Mapping) else ""
