# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What stands in an inventory and does not do what it says: no role reads it there, or Ansible takes it otherwise."""

from __future__ import annotations

import functools
import re
from collections.abc import Collection, Iterable, Iterator

from .._model.finding import Problem
from .._model.listed import wrong_waves
from .._model.pythons import too_old
from .explain import nearest_name
from .hosts import is_ours, variables_of
from .said import Hosts, Said
from .schema import variables as known_variables

NEAR = 0.9
THEIRS = ("robot_model",)  # a name that an inventory is likely to have of its own
SSH = ("", "ssh", "smart", "paramiko", "paramiko_ssh", "ansible.builtin.ssh", "ansible.builtin.paramiko_ssh")
WAVES, GIVEN = "update_waves", '-e \'{"update_waves": [1, "25%", "100%"]}\''


def inventory_problems(hostvars: Hosts, names: Iterable[str], given: Said) -> list[Problem]:
    """Of these hosts; `given` is what was given with `-e`."""
    listed = list(names)
    return [
        *_slice(given),
        *_waves(hostvars, listed, given),
        *_given_waves(given),
        *_addresses(hostvars, listed),
        *_pythons(hostvars, listed),
    ]


def near_misses(hostvars: Hosts, names: Iterable[str]) -> list[Problem]:
    """Variables that hardly differ from one of ours. They may well be the inventory's own, so they are no errors."""
    return [
        Problem(f"hosts.{host}.{name}", f"is no variable of this collection; did you mean {near}?")
        for host in names
        for name in variables_of(hostvars, host)
        if (near := _near(str(name)))
    ]


@functools.cache
def _near(name: str) -> str:
    if is_ours(name) or name in THEIRS or name.startswith("ansible_"):
        return ""
    return nearest_name(name, known_variables(), NEAR) or ""


def _waves(hostvars: Hosts, names: list[str], given: Collection[str]) -> Iterator[Problem]:
    """A play's waves are cut before any host's variables are there, so its canary would not be one."""
    for host in names:
        if WAVES in variables_of(hostvars, host) and WAVES not in given:
            yield Problem(f"hosts.{host}.{WAVES}", "has no effect in an inventory", GIVEN)


def _slice(given: Said) -> Iterator[Problem]:
    """A sliced job template of AWX is a workflow of the template's own name, each job with some of the hosts alone.

    AWX tells a job nothing else of that, so a workflow of somebody's own must not have the name of its template.
    """
    template = given.get("awx_job_template_name")
    if template and given.get("awx_workflow_job_name") == template:
        yield Problem(
            "groups",
            f"may have only some of the hosts: this job's workflow is named as its job template, {template}, which AWX "
            "does where it slices one; a slice would make other hosts servers",
            "1 for the template's job slicing (job_slice_count), as update_waves says how many hosts are changed at "
            "once; for a workflow that slices nothing another name",
        )


def _given_waves(given: Said) -> Iterator[Problem]:
    wrong = wrong_waves(given.get(WAVES))
    if wrong:
        yield Problem(WAVES, wrong, "numbers above 0 and percentages, such as 1, 25%, 100%")


def _addresses(hostvars: Hosts, names: list[str]) -> Iterator[Problem]:
    """One machine would be two hosts, each undoing what is done to the other."""
    first: dict[tuple[str, str], str] = {}
    for host in names:
        own = variables_of(hostvars, host)
        address, port, connection = (_read(own, f"ansible_{key}") for key in ("host", "port", "connection"))
        if not address or connection not in SSH:
            continue
        other = first.setdefault((address, port or "22"), host)
        if other != host:
            allowed = "an address of its own, or the ansible_port of its own behind one"
            yield Problem(f"hosts.{host}.ansible_host", f"is {address} as that of {other}", allowed)


def _pythons(hostvars: Hosts, names: list[str]) -> Iterator[Problem]:
    """Only of a host whose inventory names its Python with the version; preflight says it of all."""
    for host in names:
        program = _read(variables_of(hostvars, host), "ansible_python_interpreter")
        named = re.search(r"python(\d[.]\d+)$", program)
        if named and (wrong := too_old(named[1])):
            yield Problem(f"hosts.{host}.ansible_python_interpreter", f"is {program}: the host {wrong}")


def _read(own: Said, name: str) -> str:
    """What cannot be templated says so when somebody connects."""
    try:
        return str(own[name] or "") if name in own else ""
    except Exception:  # the templar raises a dozen kinds
        return ""
