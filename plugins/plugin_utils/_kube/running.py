# SPDX-License-Identifier: GPL-3.0-or-later
"""Containers that run another image than their image's name means by now. Pure.

A pod keeps the image that it began with. Who brings another one under the same tag changes nothing, until a container
ends by chance.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator
from typing import NamedTuple

from ...module_utils._step.objects import Object, is_terminating
from .._model import names
from .pods import containers, meta, space_of

TODO = "give the image a version of its own, or delete the pod while the robot rests"
# A node, and an image's name -> IDs that it may have there; nothing where nobody knows.
Known = Callable[[str, str], Collection[str]]


class Outdated(NamedTuple):
    """An app with such a container, and what is wrong with it."""

    namespace: str
    app: str
    what: str


def outdated(pods: Iterable[Object], known: Known) -> Iterator[Outdated]:
    """The kubelet says an image's ID, the digest of its configuration, or where containerd has one a name by digest."""
    for pod in pods:
        spec = pod.get("spec") or {}
        node = str(spec.get("nodeName") or "")
        images = {
            one["name"]: str(one["image"]) for key in ("initContainers", "containers") for one in spec.get(key) or ()
        }
        for container in () if is_terminating(pod) else containers(pod):
            image, runs = images.get(str(container.get("name")), ""), str(container.get("imageID") or "")
            if "running" in (container.get("state") or {}):
                has = {runs} if runs.startswith("sha256:") else {*known(node, runs)}
                means = {*known(node, image)}
                if has and means and not has & means:
                    app = str((meta(pod).get("labels") or {}).get(names.LABEL_APP) or meta(pod).get("name"))
                    what = f"runs another image than {image} is by now on {node}: its pod keeps the old one"
                    yield Outdated(space_of(pod), app, what)
