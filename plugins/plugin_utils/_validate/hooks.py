# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where an app's hooks run, if nobody said it: beside it, where its image is seen to have no Python for them. Pure.

What is chosen follows from the inventory and the archives that it names. A run on a control node without one of those
brings no image, and so changes no app by what it does not see.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from ansible_collections.rosops.fleet.plugins.plugin_utils._model.app import App
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.contents import Contents
from ansible_collections.rosops.fleet.plugins.plugin_utils._validate.images import Inside

OLDEST = 8  # minor version of the Python 3 that our code in the pod needs


def with_hooks(app: App, raw: Mapping[str, Any], inside: Inside) -> App:
    """The app as it is rendered. A sidecar has no place on the host's network, which is told of it (`no_python`)."""
    if raw.get("hooks") or app.host_network or not no_python(app, inside):
        return app
    return replace(app, hooks="sidecar")


def no_python(app: App, inside: Inside) -> str:
    """What the image lacks, in words; nothing where it has it, or nobody can see."""
    found: Contents | None = None if "PATH" in app.env else inside(app)
    version = found.python if found else None
    if found is None or version is None or (version and int(version.partition(".")[2]) >= OLDEST):
        return ""
    has = f"has Python {version}, which is older than 3.{OLDEST}" if version else "has no python3"
    return f"the image {app.image} in {found.archive} {has}"
