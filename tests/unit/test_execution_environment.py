# SPDX-License-Identifier: GPL-3.0-or-later
"""ansible-builder takes the definitions of an execution environment, ours and the one that docs/ee.md shows.

What it makes is the context of a build. The build itself needs a registry of images.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import yaml

CHECKOUT = Path(__file__).resolve().parents[2]
DEFINITION = CHECKOUT / "execution-environment" / "execution-environment.yml"
PAGE = CHECKOUT / "docs" / "ee.md"


def builder(*words: str | Path) -> str:
    done = subprocess.run(  # noqa: S603 - the pinned tool
        [sys.executable, "-m", "ansible_builder", *map(str, words)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def create(definition: Path, context: Path) -> tuple[str, list[dict[str, str]]]:
    """The Containerfile, and the collections that are installed by it."""
    builder("create", "--file", definition, "--context", context)
    wanted = yaml.safe_load((context / "_build" / "requirements.yml").read_text("utf-8"))
    return (context / "Containerfile").read_text("utf-8"), wanted["collections"]


def shown(first: str) -> dict[str, Any]:
    """The block of the page that begins with this key."""
    [text] = re.findall(rf"^```yaml\n({first}:.*?)^```$", PAGE.read_text("utf-8"), re.MULTILINE | re.DOTALL)
    value: dict[str, Any] = yaml.safe_load(text)
    return value


def test_ours_is_made_of_the_package_of_the_checkout(tmp_path: Path) -> None:
    definition = tmp_path / DEFINITION.relative_to(CHECKOUT)
    shutil.copytree(DEFINITION.parent, definition.parent)
    package = tmp_path / ".cache" / "ee" / "rosops-fleet.tar.gz"  # as `make ee` puts it
    package.parent.mkdir(parents=True)
    package.write_text("the package")
    containerfile, collections = create(definition, tmp_path / "context")
    assert 'ARG EE_BASE_IMAGE="quay.io/centos/centos:stream9"' in containerfile
    assert 'ARG ANSIBLE_INSTALL_REFS="ansible-core>=2.19.0,<2.20.0 ansible-runner==2.4.3"' in containerfile
    assert "COPY _build /build" in containerfile
    assert collections == [{"name": "/build/collections/rosops-fleet.tar.gz", "type": "file"}]
    assert (tmp_path / "context" / "_build" / "collections" / "rosops-fleet.tar.gz").read_text() == "the package"


def test_that_of_the_page_differs_only_in_whence_the_collection_comes(tmp_path: Path) -> None:
    definition = tmp_path / "execution-environment.yml"
    definition.write_text(yaml.safe_dump(shown("version")))
    _containerfile, collections = create(definition, tmp_path / "context")
    version = yaml.safe_load((CHECKOUT / "galaxy.yml").read_text("utf-8"))["version"]
    assert collections == [{"name": "rosops.fleet", "version": version}]
    ours, theirs = yaml.safe_load(DEFINITION.read_text("utf-8")), shown("version")
    del ours["additional_build_files"], ours["options"]["tags"]
    ours["dependencies"]["galaxy"] = theirs["dependencies"]["galaxy"]
    assert theirs == ours


def test_what_the_collection_needs_is_found_in_it(tmp_path: Path) -> None:
    place = tmp_path / "ansible_collections" / "rosops" / "fleet"
    shutil.copytree(CHECKOUT / "meta", place / "meta")
    shutil.copy(CHECKOUT / "galaxy.yml", place)
    found = yaml.safe_load(builder("introspect", tmp_path))
    python, system = ({line.partition("#")[0].strip() for line in found[kind]} for kind in ("python", "system"))
    assert python == set((CHECKOUT / "meta" / "ee-requirements.txt").read_text("utf-8").splitlines())
    assert system == set((CHECKOUT / "meta" / "ee-bindep.txt").read_text("utf-8").splitlines())
