# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Saids of images, as far as they are seen before any node has them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence

from .._model.finding import Problem, join_path
from .._model.fleet import Fleet
from .._objects.parts import images
from .said import Hosts, Said

# What archives hold in the place of an image; nothing where one has it, or nobody can see.
Instead = Callable[[Sequence[Said], str], Sequence[str]]


def archive_problems(hosts: Hosts, unusable: Callable[[str], str]) -> Iterator[Problem]:
    """Saids of which it is seen here that no node can take them."""
    for host, variables in hosts.items():
        for index, item in enumerate(_archives(variables)):
            if wrong := unusable(item["path"]):
                yield Problem(join_path("hosts", host, "images_archives", index, "path"), wrong)


def image_warnings(fleet: Fleet, hosts: Hosts, instead: Instead) -> Iterator[Problem]:
    """Images that hosts with archives will pull all the same, though nobody says so in `images_refs`."""
    remote = sorted({image for robot in fleet.robots.values() for image in images(robot, "remote")})
    for host, variables in hosts.items():
        archives = _archives(variables)
        if not archives:
            continue
        needed = images(fleet.robots[host], "local") if host in fleet.robots else remote
        for image in needed:
            if image not in (variables.get("images_refs") or ()) and (held := instead(archives, image)):
                told = f"none of them has {image}, so the node will pull it (images_refs says that this is meant)"
                yield Problem(f"hosts.{host}.images_archives", f"{told}; they hold {', '.join(held)}")


def _archives(variables: Said) -> list[Said]:
    """The items of `images_archives` that have a path; others may be wrong."""
    given = variables.get("images_archives")
    items = given if isinstance(given, list) else []
    return [item for item in items if isinstance(item, Mapping) and isinstance(item.get("path"), str)]
