# SPDX-License-Identifier: GPL-3.0-or-later
"""What the programs of the stack are configured with: the templates beside this file, filled. Pure, but that these are
read.

The labels of a pod's log lines come from its files' path and its host's name alone. No API is asked: a robot whose link
is down starts pods after a reboot, too, and their lines carry the right labels from the first one on. What is read from
names is what the collection's own objects say in their labels: a robot's pods are in `robot-<name>`, and an app's
Deployment has the app's name.
"""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import yaml
from ansible.module_utils.common.yaml import yaml_load
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from ...module_utils._exporter.families import MOST
from .spec import PORTS, RETENTION_PART, SERVERS, STORE_PART, TLS, Spec, mebibytes, runs, urls

STREAM_LABELS = ("robot", "namespace", "app", "pod", "placement")
# Folder in Grafana -> directory: the collection's own dashboards, and those of the inventory.
FOLDERS = {"Fleet": "/etc/dashboards/fleet", "Own": "/etc/dashboards/own"}
# Letters of generated names: no vowels and nothing that looks like another (k8s.io/apimachinery, util/rand).
_GENERATED = "[bcdfghjklmnpqrstvwxz2456789]"
# The owner's name: a Deployment's pod ends in -<replica set>-<5>, a DaemonSet's in -<5>, a StatefulSet's in -<number>.
APP_OF_POD = rf"(?P<app>.+?)(?:-{_GENERATED}{{5,10}}-{_GENERATED}{{5}}|-{_GENERATED}{{5}}|-[0-9]+)?"
ROBOT_OF_NAMESPACE = r"robot-(?P<robot>.+)"
# /var/log/pods/<namespace>_<pod>_<uid>/<container>/<restarts>.log
PATH = r"/var/log/pods/(?P<namespace>[^_/]+)_(?P<pod>[^_/]+)_[^/]+/(?P<container>[^/]+)/.*"
# By the names that Prometheus, Loki, Alertmanager and the collector all have for them.
OWN_CERTIFICATE = {"cert_file": f"{TLS}/tls.crt", "key_file": f"{TLS}/tls.key"}
CLIENT_TLS = {"ca_file": f"{TLS}/ca.crt", **OWN_CERTIFICATE}
SERVER_TLS = {
    **OWN_CERTIFICATE, "client_ca_file": f"{TLS}/ca.crt", "client_auth_type": "RequireAndVerifyClientCert",
}  # fmt: skip

Config = dict[str, Any]  # of a program, as that wants it


# What stands in `{{ }}` becomes one value, written as JSON, which is YAML, too; what a macro makes stays.
ENVIRONMENT = Environment(
    loader=FileSystemLoader(Path(__file__).parent),
    autoescape=True,
    undefined=StrictUndefined,
    finalize=lambda value: value if isinstance(value, Markup) else Markup(json.dumps(value)),  # noqa: S704 - no markup
    trim_blocks=True,
    lstrip_blocks=True,
)
# without a dollar, which the collector's own file takes for a variable's beginning
ENVIRONMENT.filters["anchored"] = lambda regex: rf"\A{regex}\z"
ENVIRONMENT.filters["numbered"] = lambda regex: re.sub(r"\(\?P<\w+>", "(", regex)  # its groups


def config(template: str, spec: Spec, **more: Any) -> Config:
    """What a template makes of a spec: `scrape` is the file of Prometheus or vmagent, `otelcol` the log shipper's,
    `grafana` are provisioning files by name, `pods` pods by part."""
    remote = json.dumps(sorted(set(spec["remote_nodes"])))
    values = {
        **spec,
        "wanted": runs(spec),
        "ports": PORTS,
        "urls": urls(spec),
        "servers": SERVERS,
        "client_tls": CLIENT_TLS,
        "server_tls": SERVER_TLS,
        "folders": FOLDERS,
        "state": "/var/lib/rosops-fleet/log-shipper",  # on the host
        "retention_mebibytes": mebibytes(spec["prometheus_size"], RETENTION_PART),
        "store_mebibytes": mebibytes(spec["store_size"], STORE_PART),
        "exporter_bound": MOST,
        "stream_labels": STREAM_LABELS,
        "path": PATH,
        "robot_of_namespace": ROBOT_OF_NAMESPACE,
        "app_of_pod": APP_OF_POD,
        "placement": f'EXPR(env("NODE_NAME") in {remote} ? "remote" : "local")',
        **more,
    }
    found: Config = yaml_load(ENVIRONMENT.get_template(f"{template}.yml.j2").render(values))
    return found


def web_config(spec: Spec) -> dict[str, str]:
    """The file of Prometheus and of Alertmanager that says how they serve, where it is by TLS."""
    return {"web.yml": yaml_text({"tls_server_config": SERVER_TLS})} if spec["tls_secret_name"] else {}


def yaml_text(value: Config) -> str:
    """A configuration file's text, that people can read: the same bytes for the same value, keys in the order given."""
    # Ansible's texts carry tags, which a dumper does not know, and what is shared would get an anchor
    plain = json.loads(json.dumps(value))
    return str(yaml.safe_dump(plain, sort_keys=False, width=1000, allow_unicode=True))
