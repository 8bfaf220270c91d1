#!/usr/bin/python
# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Lists files of persistent claims on their host, and reads pieces of them."""

from __future__ import annotations

DOCUMENTATION = r"""
module: claim_files
short_description: List and read the files of persistent claims on their host
version_added: 1.0.0
description:
  - Finds the directories of claims that the storage class C(local-path) keeps on the host, lists their plain files,
    and reads pieces of
    files, compressed. M(rosops.fleet.claim_collect) does its work with it.
  - Follows no link, in no part of a path, and opens nothing but plain files, as what apps write there is not trusted.
options:
  storage:
    description: The directory in which the storage class keeps claims.
    type: path
    default: /var/lib/rancher/k3s/storage
  match:
    description: Patterns of the paths of files, from the claim's directory on; C(*) matches slashes, too.
    type: list
    elements: str
    default: ["*"]
  namespaces:
    description: Namespaces of the claims whose files are listed.
    type: list
    elements: str
    default: []
  claims:
    description: Names of the claims whose files are listed. All where none is named.
    type: list
    elements: str
    default: []
  directory:
    description: The directory of one claim, to read from.
    type: str
  pieces:
    description: What to read there.
    type: list
    elements: dict
    default: []
    suboptions:
      path:
        description: The path of a file, percent-encoded, as it was listed.
        type: str
        required: true
      offset:
        description: Where to begin.
        type: int
        required: true
      length:
        description: How many bytes to read.
        type: int
        required: true
      check:
        description: The sum of so many bytes from the file's beginning is told, and the file's state.
        type: int
extends_documentation_fragment:
  - rosops.fleet._attributes.read_only
author:
  - rosops.fleet contributors (@rosops)
"""

EXAMPLES = r"""
- name: See what a robot's claims hold
  rosops.fleet.claim_files:
    namespaces: [robot-robot1]
  become: true
"""

RETURN = r"""
claims:
  description: The claims, each with C(directory), C(namespace), C(claim), its C(files) (by percent-encoded path
    C(size), C(mtime_ns),
    C(inode)), and in C(passed) the paths of what is no plain file.
  returned: if nothing is to be read
  type: list
  elements: dict
pieces:
  description: What was read, in the order in which it was asked for; C(gone) says why there is no C(data).
  returned: if something is to be read
  type: list
  elements: dict
"""

from pathlib import Path

from ansible.module_utils.basic import AnsibleModule
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import FleetError
from ansible_collections.rosops.fleet.plugins.module_utils._host.claims import claims, listing, pieces

PIECE = {
    "path": {"type": "str", "required": True},
    "offset": {"type": "int", "required": True},
    "length": {"type": "int", "required": True},
    "check": {"type": "int"},
}
ARGUMENTS = {
    "storage": {"type": "path", "default": "/var/lib/rancher/k3s/storage"},
    "match": {"type": "list", "elements": "str", "default": ["*"]},
    "namespaces": {"type": "list", "elements": "str", "default": []},
    "claims": {"type": "list", "elements": "str", "default": []},
    "directory": {"type": "str"},
    "pieces": {"type": "list", "elements": "dict", "default": [], "options": PIECE},
}


def main() -> None:
    module = AnsibleModule(argument_spec=ARGUMENTS, supports_check_mode=True)
    given = module.params
    try:
        found = claims(given["storage"])
        if given["directory"]:
            if given["directory"] not in [claim.directory for claim in found]:
                raise FleetError(f"{given['directory']} is no claim's directory any more")
            root = str(Path(given["storage"]) / given["directory"])
            module.exit_json(changed=False, pieces=pieces(root, given["pieces"]))
        listed = [
            dict(claim._asdict(), **listing(str(Path(given["storage"]) / claim.directory), given["match"])._asdict())
            for claim in found
            if claim.namespace in given["namespaces"] and claim.claim in (given["claims"] or [claim.claim])
        ]
    except (FleetError, OSError) as error:
        module.fail_json(msg=str(error))
    module.exit_json(changed=False, claims=listed)


if __name__ == "__main__":
    main()
