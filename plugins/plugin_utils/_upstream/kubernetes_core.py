# SPDX-License-Identifier: GPL-3.0-or-later
"""The private names of kubernetes.core and its library that this collection uses, each behind a name of ours.

Nothing public goes from a task's options to the client's configuration without asking the server. An upgrade that moves
one of them is seen by one test (test_upstream.py).
"""

from __future__ import annotations

from typing import Any

from ansible_collections.kubernetes.core.plugins.module_utils.k8s.client import (
    _create_auth_spec,
    _create_configuration,
    _create_headers,
)

create_auth_spec, create_configuration, create_headers = _create_auth_spec, _create_configuration, _create_headers


def remove_key_files(kube_config: Any) -> None:
    """What the client does at the interpreter's exit. Ansible's worker processes end without that."""
    clean = getattr(kube_config.kube_config, "_cleanup_temp_files", None)
    if clean:
        clean()
