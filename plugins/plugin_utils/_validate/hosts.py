# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The variables of ours among everything that an inventory says about its hosts."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from ...module_utils._common.errors import SpecError
from .._model.finding import Problem
from .._model.secrets import redact
from .explain import nearest_name
from .layers import LAYERS
from .refused import INSTEAD
from .said import Hosts, Said
from .schema import needed
from .schema import variables as known_variables

# Names with these beginnings are ours and nobody else's, so a near miss is a misspelling. `robot_`, `ros_` and `node_`
# are not on the list: an inventory may well have a robot_model of its own.
OWN_PREFIXES = (
    "k3s_",
    "images_",
    "preflight_",
    "ros_app",
    "ros_master",
    "observability_",
    "robot_namespace",
    "persistent_",
)
MISSPELT = 0.8
# What robots are made of is handed on as it is. A robot itself holds no secret of ours; what is in an app's own
# environment is as open as the Deployment that shows it.
HANDED_ON = ("ros_apps", *LAYERS, "ros_master_overrides", "ros_master_keeper_overrides", "persistent_storage")


def fleet_hosts(hostvars: Hosts, names: Iterable[str]) -> dict[str, Said]:
    """`{host: {variable: value}}` to check: known variables and misspelt ones, secrets replaced by numbers."""
    seen: dict[Any, str] = {}
    problems: list[Problem] = []
    hosts = {str(name): _picked(hostvars, str(name), seen, problems) for name in names}
    if problems:
        lines = "\n".join(problem.line() for problem in problems)
        raise SpecError(f"variables that cannot be read:\n{lines}", errors=[problem.as_dict() for problem in problems])
    return hosts


def variables_of(hostvars: Hosts, host: str) -> Said:
    """Those of a host; none of one that is not there."""
    return hostvars[host] if host in hostvars else {}  # noqa: SIM401 - hostvars is no plain mapping


def _picked(hostvars: Hosts, host: str, seen: dict[Any, str], problems: list[Problem]) -> Said:
    variables = variables_of(hostvars, host)
    picked: dict[str, Any] = {}
    for name in variables:
        if name in INSTEAD:
            picked[name] = None  # whatever its value is, it has no effect
        elif is_ours(str(name)):
            try:
                # a variable may be templated piece by piece, as it is read
                picked[str(name)] = _read(str(name), variables[name], seen)
            except Exception as error:  # the templar raises a dozen kinds for an undefined or malformed template
                if not needed(str(name)):
                    continue  # such a value may rest on what only the role's own play knows; the role will look at it
                reason = str(error).split("\n", maxsplit=1)[0]
                problems.append(
                    Problem(f"hosts.{host}.{name}", f"cannot be templated: {reason}", "a value that is defined")
                )
    return picked


def _read(name: str, value: Any, seen: dict[Any, str]) -> Any:
    return _copied(value) if name in HANDED_ON else redact({name: value}, seen)[name]


def _copied(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _copied(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_copied(item) for item in value]
    return value


def is_ours(name: str) -> bool:
    """Whether a variable is one of the collection's, or looks like a misspelt one."""
    known = known_variables()
    if name in known or name in INSTEAD:
        return True
    return name.startswith(OWN_PREFIXES) and nearest_name(name, known, MISSPELT) is not None
