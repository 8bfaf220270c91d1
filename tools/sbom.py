# SPDX-License-Identifier: GPL-3.0-or-later
"""What a release needs to run, as CycloneDX 1.6 (cyclonedx.org/docs/1.6/json): collections, packages, k3s, images.

    python tools/sbom.py > sbom.cdx.json

Versions of packages and collections are those that the release was tested with. Those of k3s and of the images are the
roles' defaults, which an inventory may change. The files of the package stand in its own FILES.json.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Mapping
from importlib import metadata
from pathlib import Path
from typing import Any

import yaml
from packaging.requirements import Requirement

CHECKOUT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(CHECKOUT / ".ansible" / "collections"))

from ansible_collections.rosops.fleet.plugins.plugin_utils._model.role_specs import role_options  # noqa: E402

COLLECTIONS = Path(str(metadata.distribution("ansible").locate_file("ansible_collections")))
# ansible-core and its own requirements
CORE = ("ansible-core", "cryptography", "Jinja2", "packaging", "PyYAML", "resolvelib")

Component = dict[str, str]


def component(kind: str, purl: str, name: str, version: str) -> Component:
    return {"type": kind, "bom-ref": f"{purl}@{version}", "name": name, "version": version, "purl": f"{purl}@{version}"}


def components(galaxy: Mapping[str, Any]) -> Iterator[Component]:
    """What the collection is built on."""
    for name in galaxy["dependencies"]:
        manifest = json.loads((COLLECTIONS / name.replace(".", "/") / "MANIFEST.json").read_text("utf-8"))
        yield component("library", f"pkg:generic/{name}", name, manifest["collection_info"]["version"])
    required = (CHECKOUT / "meta" / "ee-requirements.txt").read_text("utf-8").splitlines()
    for name in (*CORE, *(Requirement(line).name for line in required if line)):
        yield component("library", f"pkg:pypi/{name.lower()}", name, metadata.version(name))
    defaults = {role: role_options(role) for role in ("k3s", "observability", "ros_master")}
    yield component("platform", "pkg:generic/k3s", "k3s", defaults["k3s"]["k3s_version"]["default"])
    images = {option["default"] for option in defaults["observability"]["observability_images"]["options"].values()}
    for image in sorted({*images, defaults["ros_master"]["ros_master_image"]["default"]}):
        name, _, tag = image.rpartition(":")
        yield component("container", f"pkg:docker/{name}", name, tag)


def bill() -> dict[str, Any]:
    """The whole document; the same for the same checkout."""
    galaxy = yaml.safe_load((CHECKOUT / "galaxy.yml").read_text("utf-8"))
    name = f"{galaxy['namespace']}.{galaxy['name']}"
    itself = component("library", f"pkg:generic/{name}", name, galaxy["version"])
    return {
        "bomFormat": "CycloneDX",
        "specVersion": "1.6",
        "version": 1,
        "metadata": {"component": {**itself, "licenses": [{"license": {"id": "GPL-3.0-or-later"}}]}},
        "components": list(components(galaxy)),
    }


if __name__ == "__main__":
    json.dump(bill(), sys.stdout, indent=2)
