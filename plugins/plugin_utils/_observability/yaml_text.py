# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""A configuration file's text: YAML that people can read, the same bytes for the same value."""

from __future__ import annotations

import json
from typing import Any

from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError

try:
    import yaml
except ImportError:  # Ansible brings it along; only tools that import every file by itself lack it
    yaml = None  # type: ignore[assignment,unused-ignore]


def yaml_text(value: Any) -> str:
    """The value as YAML, without anchors and with its keys in the order given."""
    if yaml is None:
        raise SpecError("the Python package PyYAML is missing on the control node")

    class Plain(yaml.SafeDumper):  # type: ignore[misc,unused-ignore]
        def ignore_aliases(self, data: Any) -> bool:  # noqa: ARG002
            return True

    # Ansible's texts carry tags, which a dumper does not know
    plain = json.loads(json.dumps(value))
    text: str = yaml.dump(plain, Dumper=Plain, sort_keys=False, width=1000, allow_unicode=True)
    return text
