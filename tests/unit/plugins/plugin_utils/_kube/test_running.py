# SPDX-License-Identifier: GPL-3.0-or-later
"""A tag that means another image by now, in all forms in which a kubelet and containerd tell of images."""

from __future__ import annotations

from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._step.objects import Object
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.running import Outdated, outdated
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._kube.kube_objects import gone_soon

REF, OLD, NEW = "lab/apps:1.0", "sha256:01d", "sha256:4e3"
BY_DIGEST = "docker.io/lab/apps@sha256:a9a"  # of the manifest: so says containerd of what was pulled


def pod(image_id: str, image: str = REF, where: str = "containerStatuses", **more: Any) -> Object:
    name = "hooks" if where.startswith("init") else "ros-app"
    container = {"name": name, "imageID": image_id, "state": {"running": {}}, **more}
    return {
        "metadata": {"name": "sensor-1", "namespace": "robot-r1", "labels": {"rosops.fleet/app": "sensor"}},
        "spec": {
            "nodeName": "r1",
            "containers": [{"name": "ros-app", "image": image}],
            "initContainers": [{"name": "hooks", "image": image, "restartPolicy": "Always"}],
        },
        "status": {where: [container]},
    }


def node(**images: set[str]) -> Any:
    found = {"tag": REF, "digest": BY_DIGEST}
    said = {found[key]: value for key, value in images.items()}
    return lambda where, ref: said.get(ref, set()) if where == "r1" else set()


@pytest.mark.parametrize(
    ("there", "known", "found"),
    [
        (pod(OLD), node(tag={NEW}), True),
        (pod(NEW), node(tag={NEW}), False),
        (pod(BY_DIGEST), node(tag={NEW}, digest={OLD}), True),
        (pod(BY_DIGEST), node(tag={NEW}, digest={NEW}), False),
        (pod(BY_DIGEST), node(tag={NEW}), False),  # which image that is nobody knows here
        (pod(OLD), node(), False),  # what the tag means, neither
        (pod(OLD), node(tag={NEW, OLD}), False),  # an archive for several machines
        (pod(OLD, where="initContainerStatuses"), node(tag={NEW}), True),  # the hooks beside it
        (pod(OLD, state={"waiting": {}}), node(tag={NEW}), False),
        (pod("", state={"running": {}}), node(tag={NEW}), False),
        (pod(OLD, image=BY_DIGEST), node(digest={OLD}), False),
        (gone_soon(pod(OLD)), node(tag={NEW}), False),  # it is replaced anyway
    ],
)
def test_what_a_pod_runs_and_what_its_images_name_means(there: Object, known: Any, found: bool) -> None:
    what = "runs another image than lab/apps:1.0 is by now on r1: its pod keeps the old one"
    assert [*outdated([there], known)] == ([Outdated("robot-r1", "sensor", what)] if found else [])
