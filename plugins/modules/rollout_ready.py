#!/usr/bin/python
# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Documentation only: the work is done by the action plugin of this name, on the control node.

The options of access are some of kubernetes.core's. They are said here, because where documentation is made of a
collection alone, as on Galaxy, a fragment of another one is not found, and no module at all is shown.
"""

from __future__ import annotations

DOCUMENTATION = r"""
module: rollout_ready
short_description: Wait until Kubernetes objects are rolled out
version_added: 1.0.0
description:
  - Watches all given objects together and returns as soon as every one is rolled out by the verdicts below.
  - Fails at once, with the pod's reason, when one of them cannot get there by itself, and when O(timeout) is over,
    with everything that is still open and the last reason of each.
  - Every 10 seconds it says what is still open.
  - Changes nothing. Apply the objects with M(kubernetes.core.k8s), its own O(ignore:wait) left off.
notes:
  - The work is done by an action plugin on the control node, whatever host the task belongs to or is delegated to.
    That is what lets it print while it waits. Variables from the task's C(environment) are seen.
  - "Deployment: the controller has seen the present generation, all pods are of the present template and available, and
    every older pod is gone, terminating ones included, because two ROS nodes of one name would fight for it."
  - "DaemonSet: the same for the pods that the update strategy replaces by itself. Those of C(OnDelete) only have to be
    available; the reason counts those of an older revision."
  - "Node: Ready, without pressure."
  - "PersistentVolumeClaim: bound. One whose storage class waits for a first consumer is ready while unbound only if
    none of the given workloads uses it."
  - "StatefulSet, ReplicaSet, Job, Pod and ReplicationController are refused: their rollouts are not judged here. Wait
    for them with M(kubernetes.core.k8s_info) and its C(wait_condition)."
  - "Other kinds have no rollout and are ready as they are; they are not looked up."
  - "An object that does not exist yet is waited for."
  - "Failures: an image that cannot be pulled, a crash loop (not a first crash), a container whose configuration is
    missing, C(ProgressDeadlineExceeded), a lost claim. What can be transient has to last
    O(unschedulable_grace) seconds first: an unschedulable pod (while old pods terminate it does not count), a container
    that the runtime cannot create, refused pods (quota), a paused Deployment that is not done."
  - "While a pod of the present template is up but not ready, the last line that its probe printed is part of the
    reason. A line with C(cannot become ready: ), as this collection's probe prints it where waiting would not help, is
    a failure at once."
  - "An API that cannot be reached at the start is tried for 60 seconds. One that goes away later is tried to the end."
options:
  objects:
    description:
      - What to wait for. Each entry has C(kind), C(name), C(namespace) and optionally C(api_version), or is a full
        definition, of which only these are read.
    type: list
    elements: dict
    required: true
    aliases: [definitions]
  timeout:
    description:
      - Seconds to wait from when the API shows the objects, which may itself take 60 s. Those that old pods of a
        Deployment have for their end are not counted.
    type: float
    default: 300
  unschedulable_grace:
    description: How many seconds a problem that may be transient has to last before it is a failure.
    type: float
    default: 10
  fail_on_restart:
    description:
      - Fail as soon as a container of the present template has ended with an error even once, with its exit code and
        the last lines of its log, instead of waiting for a crash loop.
      - A pod that was ready already when the module first saw it is not blamed for its former restarts.
    type: bool
    default: false
  host: {description: 'URL of the cluster''s API. Else E(K8S_AUTH_HOST).', type: str}
  api_key: {description: Token that the API knows the caller by. Else E(K8S_AUTH_API_KEY)., type: str}
  kubeconfig:
    description: A kubeconfig, as the path of a file or as a dictionary. Else E(K8S_AUTH_KUBECONFIG).
    type: raw
  context:
    description: Which context of the kubeconfig counts, if not its current one. Else E(K8S_AUTH_CONTEXT).
    type: str
  ca_cert:
    description: File with what vouches for the API's certificate, and all in between. Else E(K8S_AUTH_SSL_CA_CERT).
    type: path
    aliases: [ssl_ca_cert]
  validate_certs:
    description: Whether the API's certificate has to be valid. Else E(K8S_AUTH_VERIFY_SSL).
    type: bool
    aliases: [verify_ssl]
  proxy: {description: URL of the HTTP proxy on the way to the API. Else E(K8S_AUTH_PROXY)., type: str}
  no_proxy:
    description: Hosts, domains and networks that no proxy is asked for, separated by commas. Else E(K8S_AUTH_NO_PROXY).
    type: str
attributes:
  check_mode: {description: 'Looks once, and does neither wait nor fail because of a verdict.', support: full}
author: rosops.fleet contributors (@rosops)
"""

EXAMPLES = r"""
- name: Apply everything of a robot
  kubernetes.core.k8s:
    resource_definition: "{{ robot_objects }}"
    apply: true
  delegate_to: localhost

- name: Wait for all of it
  rosops.fleet.rollout_ready:
    objects: "{{ robot_objects }}"
    kubeconfig: ~/.kube/config
    timeout: 120

- name: Wait for one Deployment and a node
  rosops.fleet.rollout_ready:
    objects:
      - {kind: Deployment, name: talker, namespace: robot-robot1}
      - {kind: Node, name: robot1}
"""

RETURN = r"""
objects:
  description:
    - The verdict on each object, also when the module fails. C(namespace) is empty for what has none.
    - C(verdict) is V(pass), V(wait) (not yet) or V(fail) (waiting does not mend it), C(reason) says why.
  returned: always, unless the API was out of reach
  type: list
  elements: dict
  sample:
    - kind: Deployment
      name: talker
      namespace: robot-robot1
      verdict: fail
      reason: "pod talker-7d4b9c-x2x1z, container talker: ErrImagePull: image lab/apps:2.0: not found"
elapsed:
  description: Seconds it took.
  returned: always, unless the API was out of reach
  type: float
"""
