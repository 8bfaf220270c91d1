# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The input of every filter that makes something of a robot."""

from __future__ import annotations


class ModuleDocFragment:
    """Ansible merges this into the documentation of what extends `rosops.fleet._context`."""

    DOCUMENTATION = r"""
options:
  _input:
    description:
      - A robot as M(rosops.fleet.fleet_config) returns it.
    type: dict
    required: true
"""
