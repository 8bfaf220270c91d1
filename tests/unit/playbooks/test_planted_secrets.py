# SPDX-License-Identifier: GPL-3.0-or-later
"""Secrets of every kind in an inventory, and runs that show all they can: none is on the screen or in a file."""

from __future__ import annotations

import base64
from typing import Any

import yaml
from ansible.parsing.vault import VaultLib, VaultSecret
from ansible_collections.rosops.fleet.tests.unit.playbooks.control_node import Control
from ansible_collections.rosops.fleet.tests.unit.playbooks.robot_runs import STAGES, Run, path_of, runs
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._kube.kube_server import Server

KINDS = (
    "env-password", "env-token", "env-key", "env-psk", "env-url", "env-vault", "arg-option", "arg-word", "arg-url",
    "arg-header", "param", "file-line", "file-json", "registry-login", "k3s-token", "k3s-agent-token", "k3s-vpn",
    "k3s-s3", "k3s-proxy", "k3s-registry", "grafana", "alert-mail", "become", "ssh-password",
)  # fmt: skip
PLANTED = {kind: f"Hush{number:02}{kind.replace('-', '')}Q" for number, kind in enumerate(KINDS)}
INPUTS = ("hosts.yml", "k3s.yaml", "vault-password")


class Vaulted(str):
    """What `ansible-vault encrypt_string` makes of a text."""

    __slots__ = ()


yaml.SafeDumper.add_representer(Vaulted, lambda dumper, text: dumper.represent_scalar("!vault", str(text), style="|"))


def inventory(secret: dict[str, str]) -> dict[str, Any]:
    vault = VaultLib([("default", VaultSecret(b"of the test"))]).encrypt(secret["env-vault"]).decode()
    app = {
        "name": "talker",
        "image": "x.example/talker:1",
        "command": ["run"],
        "args": [
            f"--password={secret['arg-option']}", "--token", secret["arg-word"], f"mqtt://me:{secret['arg-url']}@mqtt",
            f"Authorization: Bearer {secret['arg-header']}",
        ],
        "env": {
            "DB_PASSWORD": secret["env-password"],
            "API_TOKEN": secret["env-token"],
            "AWS_SECRET_KEY": secret["env-key"],
            "WIFI_PSK": secret["env-psk"],
            "DB": f"postgres://me:{secret['env-url']}@db/x",
            "MQTT_PASS": Vaulted(vault),
        },
        "params": {"mqtt/password": secret["param"]},
        "files": [
            {"path": "/etc/a.conf", "content": f"broker=me:{secret['file-line']}@mqtt\n"},
            {"path": "/etc/b.json", "content": f'{{"auths": {{"r.example": {{"auth": "{secret["file-json"]}"}}}}}}'},
        ],
        "pattern": "pubsub",
    }  # fmt: skip
    login = {"name": "pull", "registry": "r.example", "username": "u", "password": secret["registry-login"]}
    return {
        "planted": [app],
        "robot_namespace_pull_secrets": [login],
        "k3s_token": secret["k3s-token"],
        "k3s_agent_token": secret["k3s-agent-token"],
        "k3s_config": {
            "vpn-auth": f"name=tailscale,joinKey={secret['k3s-vpn']}",
            "etcd-s3-secret-key": secret["k3s-s3"],
        },
        "k3s_environment": {"HTTPS_PROXY": f"http://u:{secret['k3s-proxy']}@proxy:3128"},
        "k3s_registries": {"configs": {"r.example": {"auth": {"username": "u", "password": secret["k3s-registry"]}}}},
        "observability": {"grafana": {"admin_password": secret["grafana"]}},
        "observability_alertmanager_config": {"global": {"smtp_auth_password": secret["alert-mail"]}},
        "ansible_become_password": secret["become"],
        "ansible_ssh_password": secret["ssh-password"],
    }


def found(control: Control, output: str) -> dict[str, list[str]]:
    """Kind -> where its secret is, as it is or as Kubernetes writes it."""
    files = [path for path in control.folder.rglob("*") if path.is_file() and path.name not in INPUTS]
    said = {"the screen": output, **{str(path): path.read_bytes().decode("utf-8", "replace") for path in files}}
    forms = {kind: (text, base64.b64encode(text.encode()).decode().rstrip("=")[:-1]) for kind, text in PLANTED.items()}
    places = {
        kind: [where for where, text in said.items() if any(one in text for one in two)] for kind, two in forms.items()
    }
    return {kind: where for kind, where in places.items() if where}


def test_none_of_many_kinds_is_shown_or_left(server: Server, control: Control) -> None:
    hosts = yaml.safe_load((control.folder / "hosts.yml").read_text())
    hosts["all"]["vars"] |= inventory(PLANTED)
    control.write("hosts.yml", yaml.safe_dump(hosts))
    control.write("vault-password", "of the test", 0o600)
    runs(server, "robot2")
    robots, shown = "robot1,robot2", ("--vault-password-file", "vault-password", "--diff", "-vvvv")
    apps = {"ros_apps": "{{ planted }}"}  # a run's own are none
    foreseen = Run(control, robots, *shown, "--tags", STAGES, "--check", **apps)
    assert "+++ after: Deployment robot-robot1/talker" in foreseen.output
    assert found(control, foreseen.output) == {}
    done = Run(control, robots, *shown, "--tags", STAGES, **apps)
    assert PLANTED["env-vault"] in str(server.find(path_of("Deployment", "robot-robot1", "talker"))), done.output
    assert found(control, done.output) == {}
    looked = Run(control, robots, *shown, playbook="status", **apps)
    assert "APPS" in looked.output
    assert found(control, looked.output) == {}
    refused = Run(control, robots, *shown, "--tags", STAGES, robot_mode=7, **apps)
    assert refused.status != 0
    assert found(control, refused.output) == {}
