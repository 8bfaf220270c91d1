# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Our words for the options of access, beside what kubernetes.core, which reads them, takes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import yaml
from ansible_collections.kubernetes.core.plugins.module_utils.args_common import AUTH_ARG_SPEC
from ansible_collections.rosops.fleet.plugins.doc_fragments._k8s_auth import ModuleDocFragment


def kinds(options: Mapping[str, Any], nested: str) -> dict[str, Any]:
    """Of each option what a caller has to know to write it."""
    return {
        name: (one.get("type", "str"), one.get("elements"), one.get("aliases"), kinds(one.get(nested, {}), nested))
        for name, one in options.items()
    }


def test_the_documented_options_are_those_that_are_read() -> None:
    documented = yaml.safe_load(ModuleDocFragment.DOCUMENTATION)["options"]
    assert kinds(documented, "suboptions") == kinds(AUTH_ARG_SPEC, "options")
