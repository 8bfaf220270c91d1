#!/usr/bin/python
# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Documentation; the work is the action plugin's."""

from __future__ import annotations

DOCUMENTATION = r"""
module: claim_collect
short_description: Collect files of persistent claims
version_added: 1.0.0
description:
  - Brings files of the claims on a host to the control node, each into C(<dest>/<robot>/<volume>), piece by piece,
    and compares the
    SHA-256 sum of each with the robot's. Beside the directory, C(<volume>.sha256) has all sums as C(sha256sum
    --check) reads them.
  - The host needs Python 3 alone, an image nothing at all. A piece is held in memory, never a file, and the robot
    writes nothing.
  - A file that is here with the same size and time is not fetched again. One that was begun, or has grown since, goes
    on from where what
    is here ends, if that is still what the robot has.
  - A file that grew meanwhile is what it was when it was listed, with a warning. One that was changed is not kept,
    and the task fails
    when all others are here.
  - Follows no link.
options:
  listed:
    description: Name of the variable with the registered result of M(rosops.fleet.claim_files), on all hosts of the
      play.
    type: str
    required: true
  dest:
    description: The directory of the control node; relative to the current directory.
    type: path
    required: true
  namespaces:
    description: The namespaces whose claims are collected. A host of the group C(robots) gives those of its own alone;
      what it says of others is left out.
    type: list
    elements: str
    required: true
  claims:
    description: Volumes of which there has to be a claim on a host of the play.
    type: list
    elements: str
    default: []
  storage:
    description: The directory in which the storage class keeps claims.
    type: path
    default: /var/lib/rancher/k3s/storage
attributes:
  check_mode:
    description: Tells which files would be fetched.
    support: full
  diff_mode:
    description: Returns details on what has changed in diff mode.
    support: none
    details:
      - Results are data; C(files) names them.
  idempotent:
    description: A second run with the same options changes nothing, where no app writes meanwhile.
    support: full
seealso:
  - module: rosops.fleet.claim_files
author:
  - rosops.fleet contributors (@rosops)
"""

EXAMPLES = r"""
- name: See what the claims hold
  rosops.fleet.claim_files:
    namespaces: [robot-robot1]
  become: true
  register: listed

- name: Collect it
  rosops.fleet.claim_collect:
    listed: listed
    dest: results
    namespaces: [robot-robot1]
  become: true
"""

RETURN = r"""
files:
  description: The files that were not here yet.
  returned: always
  type: list
  elements: dict
  contains:
    target:
      description: The directory below O(dest).
      type: str
      sample: robot1/logs-volume
    path:
      description: The path below it.
      type: str
      sample: temperature-stats.jsonl
    size:
      description: Bytes.
      type: int
    outcome:
      description: What became of it; V(fetched), V(fetched, and written to meanwhile), V(changed meanwhile) or V(gone
        meanwhile).
      type: str
passed:
  description: What is no plain file, such as links, and was passed over.
  returned: always
  type: list
  elements: str
"""
