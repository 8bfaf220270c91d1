# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Options for the Kubernetes API; they pair with KUBE_ARGS in module_utils/_kube.py."""

from __future__ import annotations


class ModuleDocFragment:
    """Named and meant as in kubernetes.core, so that one set of variables serves both collections."""

    DOCUMENTATION = r"""
options:
  kubeconfig:
    description:
      - Path of a kubeconfig file, or its content as a dictionary.
      - Without it E(K8S_AUTH_KUBECONFIG) is used; without any option, a pod's service account or C(~/.kube/config).
    type: raw
  context:
    description: The context in the kubeconfig. Also E(K8S_AUTH_CONTEXT).
    type: str
  host:
    description: The API's URL. Also E(K8S_AUTH_HOST).
    type: str
  api_key:
    description: The token to authenticate with. Also E(K8S_AUTH_API_KEY).
    type: str
  validate_certs:
    description: Whether to verify the API server's certificate. Also E(K8S_AUTH_VERIFY_SSL).
    type: bool
    aliases: [verify_ssl]
  ca_cert:
    description: Path of the certificate that the API server's one is verified against. Also E(K8S_AUTH_SSL_CA_CERT).
    type: path
    aliases: [ssl_ca_cert]
  client_cert:
    description: Path of a client certificate. Also E(K8S_AUTH_CERT_FILE).
    type: path
    aliases: [cert_file]
  client_key:
    description: Path of the client certificate's key. Also E(K8S_AUTH_KEY_FILE).
    type: path
    aliases: [key_file]
  proxy:
    description: The URL of an HTTP proxy. Also E(K8S_AUTH_PROXY).
    type: str
  no_proxy:
    description: Hosts that are reached without the proxy, separated by commas. Also E(K8S_AUTH_NO_PROXY).
    type: str
  impersonate_user:
    description: The user to act as. Also E(K8S_AUTH_IMPERSONATE_USER).
    type: str
  impersonate_groups:
    description: The groups to act as. Also E(K8S_AUTH_IMPERSONATE_GROUPS), separated by commas.
    type: list
    elements: str
requirements:
  - kubernetes (Python library) on the control node
"""
