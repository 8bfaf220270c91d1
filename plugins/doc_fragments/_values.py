# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What messages must say, the options in conditions.VALUE_ARGS."""

from __future__ import annotations


class ModuleDocFragment:
    """Ansible merges this into the documentation of what extends `rosops.fleet._values`."""

    DOCUMENTATION = r"""
options:
  values:
    description:
      - What messages must say. They are read from the publishers themselves, without being registered with the master,
        so nobody's list of subscribers changes.
      - Each item says one thing, O(values[].above) or O(values[].below) (or both), O(values[].equals),
        O(values[].quiet) or O(values[].still). A publisher that is up and cannot be heard may say anything, and is
        waited for.
    type: list
    elements: dict
    default: []
    suboptions:
      topic:
        description: Name of the topic.
        type: str
        required: true
      field:
        description:
          - A field of its messages, such as V(percentage), V(pose.position.x) or V(status[0].level).
          - Without it V(quiet) and V(still) look at every number but those of headers.
          - A message without such a field fails the module at once, as waiting cannot mend that.
        type: str
        default: ""
      above:
        description: The field of the last message must be above this.
        type: float
      below:
        description: The field of the last message must be below this.
        type: float
      equals:
        description: The field of the last message must be this number, text or truth value.
        type: raw
      quiet:
        description:
          - For so many seconds nothing must have come but zeros; it is quiet, too, where nobody publishes.
          - For commands, such as C(/cmd_vel).
        type: float
      still:
        description:
          - For so many seconds nothing must have come but zeros, and something must have.
          - For what is measured, such as O(values[].field=twist.twist) of C(/odom).
        type: float
      tolerance:
        description: Numbers up to this count as zero, as nothing that is measured stands quite still.
        type: float
        default: 0.0
"""
