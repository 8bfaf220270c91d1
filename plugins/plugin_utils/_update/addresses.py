# SPDX-License-Identifier: GPL-3.0-or-later
"""The addresses of a master's and its keeper's Services, as the cluster has them and pods are told them. Pure.

Kubernetes gives a Service its address, so it is known once the Service is there. A Service that is gone gets the one
again that pods know: then none of them has to learn another one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from urllib.parse import urlsplit

from ...module_utils._common.documents import json_of
from .._model import context, names
from .._model.context import Robot
from .._objects.network import addresses
from .world import Live, Object

NAMES = (names.MASTER_NAME, names.KEEPER_NAME)
SERVING = (*NAMES, names.EXPORTER_NAME)  # what only serves the apps
# as collections before 1.0 told it to pods
BY_NAME = {names.MASTER_NAME: "robot", f"{names.MASTER_NAME}.{names.FLEET_NAMESPACE}": "shared"}


def located(robot: Robot, live: Live) -> Robot:
    """The robot with the addresses of its master's Services."""
    place = context.master_namespace(robot)
    there = {
        service["metadata"]["name"]: service["spec"]["clusterIP"]
        for service in live.services
        if service["metadata"]["namespace"] == place and service["metadata"]["name"] in NAMES
    }
    return replace(robot, master=replace(robot.master, addresses={**_told(place, live), **there}))


def other_master(robot: Robot, live: Live, fleet: Callable[[], Live]) -> str:
    """Whose ROS master the robot's apps run with, where the inventory has them run with another one; else nothing.

    `fleet` reads the namespace of the shared master, which most robots need not look at.
    """
    wanted, place = robot.master.mode, robot.namespace
    apps = [env for key, env in _environments(live) if key[0] == place and key[1] not in SERVING]
    uris = {env.get("ROS_MASTER_URI", "") for env in apps}
    for uri in sorted(uris - {"", context.master_uri(robot)}):
        found = _whose(uri, place, live) or _whose(uri, place, fleet())
        if not found:  # a Service that was made anew has another address than the pods know
            there = {key for key, _env in _environments(live)}
            found = "" if (context.master_namespace(robot), names.MASTER_NAME) in there else "external"
        if found and (found != wanted or wanted == "external"):
            return f"ros_master_mode {found} ({uri})"
    return ""


def _whose(uri: str, place: str, live: Live) -> str:
    """The mode of the master at this address; nothing where that cannot be told."""
    host = urlsplit(uri).hostname or ""
    if host in BY_NAME:
        return BY_NAME[host]
    if not addresses([host]):
        return "external"
    of_master = [one for one in live.services if one["metadata"]["name"] == names.MASTER_NAME]
    places = [one["metadata"]["namespace"] for one in of_master if one["spec"]["clusterIP"] == host]
    keepers = [(key[0], env) for key, env in _environments(live) if key[1] == names.KEEPER_NAME]
    places += [namespace for namespace, env in keepers if env.get("ROS_MASTER_URI") == uri]
    return next(("robot" if one == place else "shared" for one in places), "")


def _told(place: str, live: Live) -> dict[str, str]:
    """What the keeper knows of its master, and what pods of the same master know of the keeper."""
    pods = list(_environments(live))
    master = next((env.get("ROS_MASTER_URI", "") for key, env in pods if key == (place, names.KEEPER_NAME)), "")
    settings = [env.get(names.SETTINGS_ENV) or "{}" for _key, env in pods if env.get("ROS_MASTER_URI") == master]
    keepers = [json_of(text.replace("$$", "$")).get("keeper") for text in settings]
    said = {names.MASTER_NAME: master, names.KEEPER_NAME: next(filter(None, keepers), "")}
    return {name: host for name, uri in said.items() if addresses([host := urlsplit(uri).hostname or ""])}


def _environments(live: Live) -> Iterator[tuple[tuple[str, str], Mapping[str, str]]]:
    """Namespace and name of each Deployment with the variables of each of its containers.

    What only shows the graph of an external master says nothing of a master in the cluster.
    """
    for item in live.deployments:
        pod: Object = item["spec"]["template"]["spec"]
        for container in [*pod["containers"], *(pod.get("initContainers") or [])]:
            if "--keep" in (container.get("command") or ()):
                continue
            given = {one["name"]: str(one.get("value", "")) for one in container.get("env") or []}
            yield (item["metadata"]["namespace"], item["metadata"]["name"]), given
