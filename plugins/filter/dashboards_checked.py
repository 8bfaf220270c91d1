# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Filter dashboards_checked: a thin wrapper of module_utils that reads files."""

from __future__ import annotations

DOCUMENTATION = r"""
name: dashboards_checked
short_description: Grafana dashboards from files, checked before anything is applied
version_added: 0.1.0
author: rosops.fleet contributors (@rosops)
description:
  - Reads dashboards on the control node and fails with everything that Grafana would refuse or pass over in silence.
    That is what is no JSON object, has no title or no usable uid, shares its uid or title with another one, asks for
    data sources at import, or is larger than a ConfigMap.
  - Apply the ConfigMaps with server-side apply. Without it the limit is a quarter of that.
options:
  _input:
    description: Paths of the user's dashboards.
    type: list
    elements: path
    required: true
  own:
    description:
      - Paths of dashboards that come along, such as the collection's own. They are checked, too, and come first.
    type: list
    elements: path
    default: []
  base:
    description: Directory that relative paths start from. Empty is the working directory.
    type: path
    default: ""
"""

EXAMPLES = r"""
- name: Check dashboards together with the collection's own
  ansible.builtin.set_fact:
    dashboards: "{{ ['arm.json'] | rosops.fleet.dashboards_checked(own=own_files, base=inventory_dir) }}"
"""

RETURN = r"""
_value:
  description: A dashboard each, the ones of O(own) first.
  type: list
  elements: dict
  contains:
    name:
      description: Its uid, as part of the name of a Kubernetes object.
      type: str
    uid:
      description: Its uid.
      type: str
    title:
      description: Its title.
      type: str
    json:
      description: What Grafana reads, without spaces and without an id of another database.
      type: str
"""

from pathlib import Path
from typing import Any, Callable, Sequence

from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.filters import filter_module
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability.dashboards import checked


def dashboards_checked(paths: Sequence[str], own: Sequence[str] = (), base: str = "") -> list[dict[str, str]]:
    """Read and check; `own` first, so that a user's duplicate is the one that is named."""
    wanted = list(
        dict.fromkeys([*map(str, own), *(str(Path(base).expanduser() / Path(path).expanduser()) for path in paths)])
    )
    texts, missing = {}, []
    for path in wanted:
        try:
            texts[path] = Path(path).read_text("utf-8")
        except (OSError, UnicodeDecodeError) as error:
            reason = error.strerror if isinstance(error, OSError) and error.strerror else "is no text in UTF-8"
            missing.append(f"  {path}: {reason}")
    unread = "dashboards that cannot be read:\n" + "\n".join(missing) if missing else ""
    try:
        good = checked(texts.items())
    except SpecError as error:
        raise SpecError("\n".join(filter(None, [str(error), unread]))) from None
    if unread:
        raise SpecError(unread)
    return [dashboard._asdict() for dashboard in good]


class FilterModule:
    """Ansible's entry point."""

    def filters(self) -> dict[str, Callable[..., Any]]:
        """Name to function."""
        return filter_module(dashboards_checked=dashboards_checked)
