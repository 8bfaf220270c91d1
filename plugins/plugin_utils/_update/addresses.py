# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The addresses of a master's and its keeper's Services, as the cluster has them and pods are told them. Pure.

Kubernetes gives a Service its address, so it is known once the Service is there. A Service that is gone gets the one
again that pods know: then none of them has to learn another one.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import replace
from ipaddress import ip_address
from urllib.parse import urlsplit

from ansible_collections.rosops.fleet.plugins.plugin_utils._model import context, names
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.context import Robot
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.world import Live, Object

NAMES = (names.MASTER_NAME, names.KEEPER_NAME)


def located(robot: Robot, live: Live) -> Robot:
    """The robot with the addresses of its master's Services."""
    place = context.master_namespace(robot)
    there = {
        service["metadata"]["name"]: service["spec"]["clusterIP"]
        for service in live.services
        if service["metadata"]["namespace"] == place and service["metadata"]["name"] in NAMES
    }
    return replace(robot, master=replace(robot.master, addresses={**_told(place, live), **there}))


def _told(place: str, live: Live) -> dict[str, str]:
    """What the keeper knows of its master, and what pods of the same master know of the keeper."""
    pods = list(_environments(live))
    master = next((env.get("ROS_MASTER_URI", "") for key, env in pods if key == (place, names.KEEPER_NAME)), "")
    settings = [env.get(names.SETTINGS_ENV) or "{}" for _key, env in pods if env.get("ROS_MASTER_URI") == master]
    keepers = [json.loads(text.replace("$$", "$")).get("keeper") for text in settings]
    said = {names.MASTER_NAME: master, names.KEEPER_NAME: next(filter(None, keepers), "")}
    return {name: host for name, uri in said.items() if _is_address(host := urlsplit(uri).hostname or "")}


def _environments(live: Live) -> Iterator[tuple[tuple[str, str], Mapping[str, str]]]:
    """Namespace and name of each Deployment with the variables of each of its containers."""
    for item in live.deployments:
        pod: Object = item["spec"]["template"]["spec"]
        for container in [*pod["containers"], *(pod.get("initContainers") or [])]:
            given = {one["name"]: str(one.get("value", "")) for one in container.get("env") or []}
            yield (item["metadata"]["namespace"], item["metadata"]["name"]), given


def _is_address(host: str) -> bool:
    try:
        ip_address(host)
    except ValueError:
        return False
    return True
