#!/usr/bin/python
# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The documentation of an action plugin: all of it runs on the control node."""

from __future__ import annotations

DOCUMENTATION = r"""
module: node_images
short_description: Bring container images to a k3s node
version_added: 1.0.0
description:
  - Compares images by ID, so what is there does not travel again. On a node that has everything it costs one command.
  - Imports archives of the control node, lets the node pull the other names, and verifies that every image is there.
    Of an archive only the layers travel that the node lacks.
  - Pins the images, so that the kubelet does not delete them when the disk fills; of each repository what was wanted or
    ran before stays pinned, too.
  - Runs as an action plugin on the control node. The host needs k3s and Python's standard library.
author:
  - rosops.fleet contributors (@rosops)
options:
  archives:
    description: Archives (docker or OCI) on the control node, plain or compressed by gzip.
    type: list
    elements: dict
    default: []
    suboptions:
      path:
        description: Path of the archive.
        type: path
        required: true
      images:
        description: Use only these of its images. Empty means all.
        type: list
        elements: str
        default: []
  names:
    description:
      - Names of images that have to be there. The node pulls those that it lacks and that no archive holds.
    type: list
    elements: str
    default: []
  logins:
    description:
      - Credentials for registries from which the node pulls, as C(robot_namespace_pull_secrets) has them. They are on
        no command line and in no log.
    type: list
    elements: dict
    default: []
    suboptions:
      name:
        description: The name of a Secret. Without a registry it is one that somebody else keeps, and is not used here.
        type: str
      registry:
        description: The registry's host name, with a path where the credentials are for a part of it.
        type: str
      username:
        description: The user.
        type: str
      password:
        description: The password or token.
        type: str
  rate_limit:
    description:
      - Upper limit of the transfer as rsync's C(--bwlimit), KiB/s or with a unit as C(2m). Empty means none.
      - With a limit rsync is needed at both ends and the collection ansible.posix on the control node. An interrupted
        transfer resumes.
    type: str
    default: ""
  directory:
    description: Directory on the host for archives until they are imported. It is removed afterwards.
    type: path
    default: /var/lib/rancher/rosops-fleet-images
attributes:
  action:
    description: Runs on the control node, and modules on the host.
    support: full
  check_mode:
    description: Looks, and says what would be imported and pulled. A host without k3s has no images.
    support: full
  diff_mode:
    description: Names and IDs before and after.
    support: full
"""

EXAMPLES = r"""
- name: Bring the apps' images
  rosops.fleet.node_images:
    archives:
      - path: /srv/images/apps-1.0.tar
    names: [docker.io/library/redis:7.4]
  become: true
  throttle: 4
"""

RETURN = r"""
imported:
  description: Archives that were imported.
  returned: success
  type: list
  elements: str
pulled:
  description: Names that were pulled.
  returned: success
  type: list
  elements: str
images:
  description: The names that were asked for, in full, with the IDs that they have on the node.
  returned: success
  type: dict
  sample: {"docker.io/library/redis:7.4": "sha256:4b9a..."}
pins:
  description: "Names whose pin has changed: C(wanted), C(before) for what a step may go back to, empty for what is let
    go."
  returned: success
  type: dict
  sample: {"docker.io/lab/apps:1.1": wanted, "docker.io/lab/apps:1.0": before}
present:
  description:
    - The full names of all images that the node has now, or in check mode would have, with their IDs; nothing where
      nothing was asked for.
  returned: success, and where bringing one failed
  type: dict
"""
