# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which cluster, and by whose rights: the options that every task has that calls the Kubernetes API.

They are those of kubernetes.core. Said here, because where documentation is made of a collection alone, as on Galaxy, a
fragment of another one is not found, and no module at all is shown.
"""

from __future__ import annotations


class ModuleDocFragment:
    DOCUMENTATION = r"""
options:
  host:
    description:
      - URL of the cluster's API. Else E(K8S_AUTH_HOST).
    type: str
  api_key:
    description:
      - Token that the API knows the caller by. Else E(K8S_AUTH_API_KEY).
    type: str
  kubeconfig:
    description:
      - A kubeconfig, as the path of a file or as a dictionary. Else E(K8S_AUTH_KUBECONFIG).
    type: raw
  context:
    description:
      - Which context of the kubeconfig counts, if not its current one. Else E(K8S_AUTH_CONTEXT).
    type: str
  username:
    description:
      - User for basic authentication. Else E(K8S_AUTH_USERNAME).
    type: str
  password:
    description:
      - This user's password. Else E(K8S_AUTH_PASSWORD).
    type: str
  client_cert:
    description:
      - File with the certificate that the caller shows. Else E(K8S_AUTH_CERT_FILE).
    type: path
    aliases: [cert_file]
  client_key:
    description:
      - File with the private key of O(client_cert). Else E(K8S_AUTH_KEY_FILE).
    type: path
    aliases: [key_file]
  ca_cert:
    description:
      - File with the authority that vouches for the API's certificate, and all in between. Else
        E(K8S_AUTH_SSL_CA_CERT).
    type: path
    aliases: [ssl_ca_cert]
  validate_certs:
    description:
      - Whether the API's certificate has to be valid. Else E(K8S_AUTH_VERIFY_SSL).
    type: bool
    aliases: [verify_ssl]
  proxy:
    description:
      - URL of the HTTP proxy on the way to the API. Else E(K8S_AUTH_PROXY).
    type: str
  no_proxy:
    description:
      - Hosts, domains and networks that no proxy is asked for, separated by commas. Else E(K8S_AUTH_NO_PROXY).
    type: str
  proxy_headers:
    description:
      - What the proxy is told beside the request.
    type: dict
    suboptions:
      proxy_basic_auth:
        description:
          - User and password at the proxy, with a colon between them. Else E(K8S_AUTH_PROXY_HEADERS_PROXY_BASIC_AUTH).
        type: str
      basic_auth:
        description:
          - User and password, with a colon between them. Else E(K8S_AUTH_PROXY_HEADERS_BASIC_AUTH).
        type: str
      user_agent:
        description:
          - The caller's program, such as V(fleet/1.0). Else E(K8S_AUTH_PROXY_HEADERS_USER_AGENT).
        type: str
  persist_config:
    description:
      - Whether a token that was renewed on the way is written into the kubeconfig. Else E(K8S_AUTH_PERSIST_CONFIG).
    type: bool
  impersonate_user:
    description:
      - User in whose name it is done. Else E(K8S_AUTH_IMPERSONATE_USER).
    type: str
  impersonate_groups:
    description:
      - Groups in whose name it is done. Else E(K8S_AUTH_IMPERSONATE_GROUPS), separated by commas.
    type: list
    elements: str
"""
