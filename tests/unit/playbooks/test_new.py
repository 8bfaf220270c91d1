# SPDX-License-Identifier: GPL-3.0-or-later
"""A fleet's own repository, as `rosops.fleet.new` makes it outside of any checkout, and what works in it at once."""

from __future__ import annotations

import base64
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from ansible_collections.rosops.fleet.plugins.plugin_utils._repository.contents import PLAYBOOKS

CHECKOUT = Path(__file__).resolve().parents[3]
COLLECTIONS = CHECKOUT / ".ansible" / "collections"
BIN = Path(sys.executable).parent


def run(where: Path, program: str, *arguments: str, **environ: str) -> subprocess.CompletedProcess[str]:
    """As a user does who has the collection in a place of his own, and nothing else set."""
    home = Path(environ.pop("HOME", str(where.parent / "home")))
    home.mkdir(exist_ok=True)
    left_out = ("ANSIBLE_", "K8S_AUTH_", "KUBE")
    environment = {key: value for key, value in os.environ.items() if not key.startswith(left_out)}
    path = f"{BIN}:{environment['PATH']}"
    environment |= {"HOME": str(home), "PATH": path, "ANSIBLE_NOCOLOR": "1", "LC_ALL": "C.UTF-8", **environ}
    collections = home / ".ansible" / "collections"
    if not collections.exists():
        collections.parent.mkdir(exist_ok=True)
        collections.symlink_to(COLLECTIONS)
    return subprocess.run(  # noqa: S603 - our own
        [str(BIN / program), *arguments], cwd=where, env=environment, capture_output=True, text=True, check=False,
        timeout=300,
    )  # fmt: skip


def new(where: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    return run(where, "ansible-playbook", "rosops.fleet.new", "-e", "dest=My_Fleet", *arguments)


def changed(done: subprocess.CompletedProcess[str]) -> int:
    assert done.returncode == 0, done.stdout + done.stderr
    found = re.search(r"localhost .*changed=(\d+)", done.stdout)
    assert found, done.stdout
    return int(found[1])


@pytest.fixture(scope="module")
def outside(tmp_path_factory: pytest.TempPathFactory) -> Path:
    where = tmp_path_factory.mktemp("outside")
    assert changed(new(where)) == 1
    return where


@pytest.fixture(scope="module")
def repository(outside: Path) -> Path:
    return outside / "My_Fleet"


def test_it_is_valid_at_once_under_the_name_of_its_directory(repository: Path) -> None:
    done = run(repository, "ansible-playbook", "validate.yml", "-v")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "[WARNING]" not in done.stdout + done.stderr
    assert "FLEET REPORT" in done.stdout, "the callback is not enabled"
    variables = yaml.safe_load((repository / "inventory" / "group_vars" / "all.yml").read_text())
    assert variables["fleet_name"] == "my-fleet"
    listed = yaml.safe_load(run(repository, "ansible-inventory", "--list").stdout)
    assert (listed["edge"]["hosts"], listed["robots"]["hosts"]) == (["edge1"], ["robot1", "robot2"])


@pytest.fixture(scope="module")
def launched(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The example with a launch file."""
    where = tmp_path_factory.mktemp("launched")
    assert changed(new(where, "-e", "example=launch")) == 1
    return where / "My_Fleet"


def test_the_example_with_a_launch_file_is_valid_and_clean_at_once(launched: Path) -> None:
    for program, *arguments in (
        ["ansible-playbook", "validate.yml"],
        ["ansible-playbook", "--syntax-check", "secrets.yml"],
        ["yamllint", "--strict", "."],
        ["ansible-lint", "--offline"],
    ):
        done = run(launched, program, *arguments)
        assert done.returncode == 0, done.stdout + done.stderr
        assert "[WARNING]" not in done.stdout + done.stderr
    image = launched / "images" / "base-1.0.tar"
    image.touch()
    asked = ["robot1", "-m", "debug", "-a", "var=images_archives"]
    shown = run(launched, "ansible", *asked, ANSIBLE_CALLBACK_RESULT_FORMAT="json").stdout
    archives = json.loads(shown.partition("=> ")[2])
    assert [Path(item["path"]).resolve() for item in archives["images_archives"]] == [image]
    image.unlink()


K3S = """#!/bin/sh
# keeps what it is given, one directory for each host
cat >{where}/new
cmp -s {where}/new {where}/old && echo secret/cloud-1 unchanged && exit
mv {where}/new {where}/old && echo "$@" >{where}/words && echo secret/cloud-1 configured
"""


def test_its_secrets_are_applied_on_the_server_of_each_robot_s_cluster(launched: Path, tmp_path: Path) -> None:
    hosts = {}
    for host in ("edge1", "robot1", "robot2"):
        asked = tmp_path / host
        asked.mkdir()
        (asked / "k3s").write_text(K3S.format(where=asked))
        (asked / "k3s").chmod(0o755)
        shell = f"/usr/bin/env PATH={asked}:/usr/bin:/bin /bin/sh"
        hosts[host] = {"ansible_connection": "local", "ansible_shell_executable": shell}
    hosts["robot2"]["robot_mode"] = "standalone"
    given = {"ansible_become": False, "ansible_python_interpreter": sys.executable, "vault_cloud_token": "open sesame"}
    (tmp_path / "local.yml").write_text(yaml.safe_dump({"all": {"hosts": hosts, "vars": given}}))
    words = ("-i", "inventory", "-i", str(tmp_path / "local.yml"), "secrets.yml")
    done = run(launched, "ansible-playbook", *words)
    assert (done.returncode, done.stdout.count("changed=1")) == (0, 2), done.stdout + done.stderr
    assert "sesame" not in done.stdout
    for host, robot in (("edge1", "robot1"), ("robot2", "robot2")):
        assert (tmp_path / host / "words").read_text() == "kubectl apply --filename -\n"
        secret = json.loads((tmp_path / host / "old").read_text())
        assert (secret["kind"], secret["metadata"]) == ("Secret", {"name": "cloud-1", "namespace": f"robot-{robot}"})
        assert base64.b64decode(secret["data"]["token"]) == b"open sesame"
    assert not (tmp_path / "robot1" / "words").exists()
    done = run(launched, "ansible-playbook", *words)
    assert (done.returncode, done.stdout.count("changed=0")) == (0, 2), done.stdout + done.stderr


@pytest.mark.parametrize(
    ("given", "said"),
    [(["-e", "dest=My_Fleet", "-e", "example=lunch"], "talker, launch"), ([], "-e dest=my-fleet")],
    ids=["an example that is not there", "no directory"],
)
def test_what_can_be_given_is_said_and_nothing_is_written(tmp_path: Path, given: list[str], said: str) -> None:
    done = run(tmp_path, "ansible-playbook", "rosops.fleet.new", *given)
    assert done.returncode == 2
    assert said in done.stdout
    assert list(tmp_path.iterdir()) == []


def test_its_yaml_is_clean_with_passwords_as_an_encrypted_part_of_the_inventory(
    repository: Path, tmp_path: Path
) -> None:
    """ansible-lint, which takes its time, reads the other example, which has all files of this one."""
    (tmp_path / "password").write_text("open")
    vault = repository / "inventory" / "vault.yml"
    vault.write_text((repository / "vault.example.yml").read_text())
    try:
        key = ("--vault-password-file", str(tmp_path / "password"))
        assert run(repository, "ansible-vault", "encrypt", *key, "inventory/vault.yml").returncode == 0
        assert run(repository, "ansible-playbook", "validate.yml", *key).returncode == 0
        done = run(repository, "yamllint", "--strict", ".")
        assert done.returncode == 0, done.stdout
    finally:
        vault.unlink()


def test_a_second_run_changes_nothing_and_what_differs_stays_unless_forced(outside: Path, repository: Path) -> None:
    assert changed(new(outside)) == 0
    hosts, lost = repository / "inventory" / "hosts.yml", repository / "site.yml"
    example = hosts.read_text()
    hosts.write_text("mine: {}\n")
    lost.unlink()
    checked = new(outside, "--check", "--diff")
    assert changed(checked) == 1
    assert "+- name: From bare hosts" in checked.stdout
    assert not lost.exists()
    assert "mine" not in checked.stdout, "what stays is no difference"
    done = new(outside)
    assert changed(done) == 1
    assert lost.exists()
    assert hosts.read_text() == "mine: {}\n"
    assert "stay as they are" in done.stdout
    assert "inventory/hosts.yml" in done.stdout
    forced = new(outside, "-e", "force=yes", "--diff")
    assert changed(forced) == 1
    assert "-mine: {}" in forced.stdout
    assert hosts.read_text() == example


def test_the_checkout_has_the_repository_s_playbooks_and_they_lead_to_its_collection(tmp_path: Path) -> None:
    where = str(COLLECTIONS)
    words = ["-i", "robot1,", "--syntax-check", *PLAYBOOKS]
    done = run(CHECKOUT, "ansible-playbook", *words, HOME=str(tmp_path), ANSIBLE_COLLECTIONS_PATH=where)
    assert done.returncode == 0, done.stdout + done.stderr
