# SPDX-License-Identifier: GPL-3.0-or-later
"""A stack's spec out of the few settings that a test is about; the others are the role's defaults."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from ansible_collections.rosops.fleet.plugins.plugin_utils._model.role_specs import role_options
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability.spec import Spec, spec_of
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.world import Object


def full(settings: Mapping[str, Any]) -> Spec:
    """`{"store_size": "1Gi", "loki": {"enabled": False}}` and the rest, by the spec's own keys."""
    options = role_options("observability")
    variables = {name: option.get("default") for name, option in options.items()}
    place, mapping = dict[str, Any](), dict[str, Any]()
    for name, value in settings.items():
        if name in ("robot", "remote_nodes"):
            place[name] = value
        elif name in options["observability"]["options"]:
            mapping[name] = value
        else:
            assert f"observability_{name}" in options
            variables[f"observability_{name}"] = value
    return spec_of({**variables, "observability": mapping}, **place)


def templates(objects: Iterable[Object]) -> dict[str, Any]:
    """The pod templates of Deployments and DaemonSets, by name."""
    return {one["metadata"]["name"]: one["spec"]["template"] for one in objects if "template" in one.get("spec", {})}
