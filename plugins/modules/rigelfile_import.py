#!/usr/bin/python
# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Documentation; the work is the action plugin's."""

from __future__ import annotations

DOCUMENTATION = r"""
module: rigelfile_import
short_description: Turn a Rigelfile into the inventory of a fleet
version_added: 1.0.0
description:
  - Reads the jobs, sequences and variables of a Rigelfile (Rigel's configuration, with the dissertation's
    orchestration plugin) and
    writes the inventory of a fleet that does the same, and C(IMPORT.md), which says of every key what became of it.
  - Hosts are placeholders, as a Rigelfile knows none.
  - What it would write is held against the fleet's whole validation before anything is written. What does not pass is
    an error with the
    place in the Rigelfile.
  - Runs on the control node. It runs nothing of Rigel's and contacts nobody.
options:
  src:
    description: The Rigelfile; relative to the current directory.
    type: path
    required: true
  dest:
    description: The directory that becomes the repository; relative to the current directory.
    type: path
    required: true
  inventory:
    description: Where the inventory goes, below O(dest). Empty is O(dest) itself.
    type: str
    default: inventory
  fleet_name:
    description: The fleet's name. Without it that of O(dest).
    type: str
    default: ""
  force:
    description: Whether files that are there with another text are overwritten. Else they are named, and nothing is
      written.
    type: bool
    default: false
notes:
  - A variable that is not under C(vars) is taken from the environment, as by Rigel. Its value is written nowhere.
  - Grafana's password is left out, as a password does not belong into plain text.
attributes:
  check_mode:
    description: Says all and writes nothing.
    support: full
  diff_mode:
    description: Shows the texts of the files that differ.
    support: full
  idempotent:
    description: A second run with the same options changes nothing.
    support: full
author:
  - rosops.fleet contributors (@rosops)
"""

EXAMPLES = r"""
- name: Make a fleet of a Rigelfile
  rosops.fleet.rigelfile_import:
    src: Rigelfile
    dest: my-fleet
"""

RETURN = r"""
files:
  description: The files that were written, or in check mode would be, below O(dest).
  returned: success
  type: list
  elements: str
kept:
  description: The files that are there with another text.
  returned: failure because of them
  type: list
  elements: str
notes:
  description: What became of the keys.
  returned: success
  type: list
  elements: dict
  contains:
    path:
      description: Where the key stands in the Rigelfile.
      type: str
      sample: jobs.deploy_k8s.with.orchestration.rolling_update.strategy
    verdict:
      description: How it fared; V(taken), V(the same), V(another way), V(no counterpart) or V(to fill in).
      type: str
      sample: taken
    told:
      description: Where it is now, or why not and what to do.
      type: str
      sample: "handoff: overlap"
"""
