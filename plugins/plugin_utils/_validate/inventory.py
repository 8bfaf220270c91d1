# SPDX-License-Identifier: GPL-3.0-or-later
"""The variables of ours among everything that an inventory says about its hosts, and what does not do there what it
says: nothing reads it, no role reads it there, or Ansible takes it otherwise."""

from __future__ import annotations

import functools
import math
import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from ...module_utils._common.errors import SpecError
from .._model.finding import Problem, join_path, shown, taken
from .._model.formats import wrong_waves
from .._model.merge import LAYERS, layered
from .._model.secrets import redact
from .draft import Hosts, Said
from .schema import nearest_name, needed
from .schema import variables as known_variables

# Names with these beginnings are ours and nobody else's, so a near miss is a misspelling. `robot_`, `ros_` and `node_`
# are not on the list: an inventory may well have a robot_model of its own.
OURS = re.compile("k3s_|images_|preflight_|ros_app|ros_master|observability_|robot_namespace|persistent_")
MISSPELT = 0.8
# What robots are made of is handed on as it is. A robot itself holds no secret of ours; what is in an app's own
# environment is as open as the Deployment that shows it.
HANDED_ON = ("ros_apps", *LAYERS, "ros_master_overrides", "ros_master_keeper_overrides", "persistent_storage")
NEAR = 0.9
THEIRS = ("robot_model",)  # a name that an inventory is likely to have of its own
SSH = ("", "ssh", "smart", "paramiko", "paramiko_ssh", "ansible.builtin.ssh", "ansible.builtin.paramiko_ssh")
WAVES, GIVEN = "update_waves", '-e \'{"update_waves": [1, "25%", "100%"]}\''

# Keys of a Rigelfile; docs/rigel.md has all of them.
RIGEL = {
    "additional_k8s_params": "the keys and overrides of an app in ros_apps; for the master ros_master_overrides",
    "deploy_ros_master": "ros_master_mode, which is robot, shared, or external with ros_master_uri",
    "distributed": "placement of an app in ros_apps, which is local or remote",
    "readiness": "readiness of an app in ros_apps",
    "rolling_update": "pattern or handoff of an app in ros_apps",
    "ros_version": "nothing: an app's image has its ROS, and that is ROS 1; ROS 2 is not served",
}


def fleet_hosts(hostvars: Hosts, names: Iterable[str], problems: list[Problem]) -> dict[str, Said]:
    """`{host: {variable: value}}` to check: known variables and misspelt ones, all apps of a robot in one list, secrets
    replaced by numbers. A key of a Rigelfile, and what YAML can say beyond JSON's types, becomes a problem.

    SpecError names everything that cannot be templated.
    """
    seen: dict[str, str] = {}
    unread: list[Problem] = []
    hosts = {name: _picked(hostvars.get(name, {}), f"hosts.{name}", seen, problems, unread) for name in names}
    if unread:
        lines = "\n".join(problem.line() for problem in unread)
        raise SpecError(f"variables that cannot be read:\n{lines}", errors=[problem._asdict() for problem in unread])
    return {name: layered(said, f"hosts.{name}", problems) for name, said in hosts.items()}


def _picked(
    variables: Said, path: str, seen: dict[str, str], problems: list[Problem], unread: list[Problem]
) -> dict[str, Any]:
    picked: dict[str, Any] = {}
    for name in map(str, variables):
        where = join_path(path, name)
        if name in RIGEL:
            problems.append(Problem(where, "is a key of a Rigelfile and has no effect here", RIGEL[name]))
        elif is_ours(name):
            try:
                # a variable may be templated piece by piece, as it is read
                value = plain(variables[name], where, problems)
            except Exception as error:  # the templar raises a dozen kinds for an undefined or malformed template
                if needed(name):  # else it may rest on what only the role's own play knows; the role will look at it
                    reason = str(error).split("\n", maxsplit=1)[0]
                    unread.append(Problem(where, f"cannot be templated: {reason}", "a value that is defined"))
            else:
                picked[name] = value if name in HANDED_ON else redact(name, value, seen)
    return picked


def plain(value: Any, path: str, problems: list[Problem]) -> Any:
    """The value with text keys and JSON's types only; what YAML can say beyond that becomes a problem.

    YAML reads `on:` as a key that is true, `2026-01-01` as a date and `8080:` as a key that is a number.
    """
    if isinstance(value, Mapping):
        for key in value:
            if not isinstance(key, str):
                problems.append(Problem(path, f"has the key {shown(key)}, which is no text", "keys in quotes"))
        return {str(key): plain(item, join_path(path, str(key)), problems) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item, join_path(path, index), problems) for index, item in enumerate(value)]
    if isinstance(value, float) and not math.isfinite(value):
        problems.append(Problem(path, f"is {value}", "a finite number"))
        return 0
    if value is None or isinstance(value, (bool, int, float)):
        return value
    if not isinstance(value, str):
        kind = next(name for name in (kind.__name__ for kind in type(value).__mro__) if name[0] != "_")  # Ansible's own
        problems.append(Problem(path, f"is a {kind}", "text (in quotes), a number, true or false, a list, a mapping"))
    return str(value)


def is_ours(name: str) -> bool:
    """Whether a variable is one of the collection's, or looks like a misspelt one."""
    known = known_variables()
    if name in known or name in RIGEL:  # most are, and to look for the nearest name takes milliseconds
        return True
    return bool(OURS.match(name) and nearest_name(name, known, MISSPELT))


def inventory_problems(hostvars: Hosts, names: Iterable[str], given: Said) -> Iterator[Problem]:
    """Of these hosts; `given` is what was given with `-e`."""
    # A sliced job template of AWX is a workflow of the template's own name, each job with some of the hosts alone. AWX
    # tells a job nothing else of that, so a workflow of somebody's own must not have the name of its template.
    template = given.get("awx_job_template_name")
    if template and given.get("awx_workflow_job_name") == template:
        yield Problem(
            "groups",
            f"may have only some of the hosts: this job's workflow is named as its job template, {template}, which AWX "
            "does where it slices one; a slice would make other hosts servers",
            "1 for the template's job slicing (job_slice_count), as update_waves says how many hosts are changed at "
            "once; for a workflow that slices nothing another name",
        )
    if wrong := wrong_waves(given.get(WAVES)):
        yield Problem(WAVES, wrong, "numbers above 0 and percentages, such as 1, 25%, 100%")
    at: list[tuple[str, tuple[str, str]]] = []
    for host in names:
        own = hostvars.get(host, {})
        address, port, connection = (_read(own, f"ansible_{key}") for key in ("host", "port", "connection"))
        if address and connection in SSH:
            at.append((host, (address, port or "22")))
        # a play's waves are cut before any host's variables are there, so its canary would not be one
        if WAVES in own and WAVES not in given:
            yield Problem(f"hosts.{host}.{WAVES}", "has no effect in an inventory", GIVEN)
    # one machine would be two hosts, each undoing what is done to the other
    for host, place, other in taken(at):
        allowed = "an address of its own, or the ansible_port of its own behind one"
        yield Problem(f"hosts.{host}.ansible_host", f"is {place[0]} as that of {other}", allowed)


def near_misses(hostvars: Hosts, names: Iterable[str]) -> Iterator[Problem]:
    """Variables that hardly differ from one of ours. They may well be the inventory's own, so they are no errors."""
    for host in names:
        for name in hostvars.get(host, {}):
            if near := _near(str(name)):
                yield Problem(f"hosts.{host}.{name}", f"is no variable of this collection; did you mean {near}?")


@functools.cache
def _near(name: str) -> str:
    if is_ours(name) or name in THEIRS or name.startswith("ansible_"):
        return ""
    return nearest_name(name, known_variables(), NEAR)


def _read(own: Said, name: str) -> str:
    """What cannot be templated says so when somebody connects."""
    try:
        return str(own[name] or "") if name in own else ""
    except Exception:  # the templar raises a dozen kinds
        return ""
