# SPDX-License-Identifier: GPL-3.0-or-later
"""The package as Galaxy gets it and as its users have it: looked at by Galaxy's importer, installed, and run from there.

Nothing of the checkout takes part in it: the directory, the home and the collections path are empty ones.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).resolve().parents[2]
NOTHING_LISTENS = "1"  # a port
# Galaxy says this of any such file; ours name the plugins that are private, whose documentation is none of users'
IGNORE_FILES = "WARNING: Ignore files skip ansible-test sanity tests"
# It has no collections, not even ours: what playbooks import from ours or ask of others, it does not find.
NO_COLLECTIONS = re.compile(
    r"Failed to find rosops\.fleet\.\w+ playbook|awx\.awx\.|'ansible\.posix\.synchronize'"
    r"|--syntax-check -vv playbooks/files/repository/"
)


@dataclass(frozen=True)
class Elsewhere:
    """A directory in which somebody who has no checkout works."""

    directory: Path

    def run(self, *words: str | Path, python: str = sys.executable) -> subprocess.CompletedProcess[str]:
        """One of Ansible's commands; ours are in an environment that the collection is not linked into."""
        tool, *rest = map(str, words)
        environment = {
            "PATH": f"{Path(python).parent}{os.pathsep}{os.defpath}",
            "HOME": str(self.directory / "home"),
            "LC_ALL": "C.UTF-8",
            "COLUMNS": "200",
            "ANSIBLE_COLLECTIONS_PATH": str(self.directory / "collections"),
        }
        return subprocess.run(  # noqa: S603 - Ansible's own commands
            [str(Path(python).parent / tool), *rest],
            cwd=self.directory,
            env=environment,
            capture_output=True,
            text=True,
            check=False,
        )

    @property
    def collection(self) -> Path:
        return self.directory / "collections" / "ansible_collections" / "rosops" / "fleet"


@pytest.fixture(scope="module")
def package() -> Path:
    """As `make package` left it."""
    [found] = (CHECKOUT / ".cache" / "package").glob("rosops-fleet-*.tar.gz")
    return found


@pytest.fixture(scope="module")
def elsewhere(package: Path, tmp_path_factory: pytest.TempPathFactory) -> Elsewhere:
    directory = tmp_path_factory.mktemp("elsewhere")
    (directory / "home").mkdir()
    found = Elsewhere(directory)
    # offline: the collections that ours needs come with the package `ansible`
    done = found.run("ansible-galaxy", "collection", "install", "--offline", "-p", "collections", package)
    assert done.returncode == 0, done.stderr
    assert found.collection.is_dir()
    return found


def test_galaxys_importer_has_nothing_to_say_against_it(package: Path, tmp_path: Path) -> None:
    python = Path(os.environ["ROSOPS_IMPORTER_PYTHON"])
    done = subprocess.run(  # noqa: S603 - from the environment that `make dist` made
        [str(python), "-m", "galaxy_importer.main", str(package)],
        cwd=tmp_path,
        env={"PATH": f"{python.parent}{os.pathsep}{os.defpath}", "HOME": str(tmp_path), "LC_ALL": "C.UTF-8"},
        capture_output=True,
        text=True,
        check=False,
    )
    said = done.stdout + done.stderr
    assert done.returncode == 0, said
    assert "Importer processing completed successfully" in said
    complaints = [line for line in said.splitlines() if line.startswith(("WARNING", "ERROR"))]
    assert not [one for one in complaints if not (one.startswith(IGNORE_FILES) or NO_COLLECTIONS.search(one))]
    result = json.loads((tmp_path / "importer_result.json").read_text("utf-8"))
    roles = {one["name"]: one for one in result["contents"] if one["content_type"] == "role"}
    assert roles.keys() == {path.name for path in (CHECKOUT / "roles").iterdir()}
    assert all(one["description"] for one in roles.values())
    documented = {
        one["content_name"]: one["doc_strings"]["doc"]["short_description"]
        for one in result["docs_blob"]["contents"]
        if one["content_type"] == "module"
    }
    assert documented.keys() == {path.stem for path in (CHECKOUT / "plugins" / "modules").glob("*.py")}


def test_what_is_installed_documents_itself(elsewhere: Elsewhere) -> None:
    module = elsewhere.run("ansible-doc", "--json", "rosops.fleet.ros_ready")
    assert module.returncode == 0, module.stderr
    shown = json.loads(module.stdout)["rosops.fleet.ros_ready"]["doc"]
    assert shown["filename"] == str(elsewhere.collection / "plugins" / "modules" / "ros_ready.py")
    role = elsewhere.run("ansible-doc", "--type", "role", "rosops.fleet.update")
    assert role.returncode == 0, role.stderr
    assert "update_failure_budget" in role.stdout


def test_the_example_inventory_of_the_package_is_valid(elsewhere: Elsewhere) -> None:
    done = elsewhere.run(
        "ansible-playbook", "-i", elsewhere.collection / "inventories" / "example", "rosops.fleet.validate"
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert re.search(r"^edge1 .* failed=0 ", done.stdout, re.MULTILINE)


def test_status_says_which_hosts_cannot_be_reached(elsewhere: Elsewhere) -> None:
    fleet = elsewhere.directory / "my-fleet"
    shutil.copytree(elsewhere.collection / "inventories" / "example", fleet)
    hosts = (fleet / "hosts.yml").read_text("utf-8")
    (fleet / "hosts.yml").write_text(hosts.replace("192.0.2.", "127.0.0."))  # refused at once, and by none but us
    done = elsewhere.run("ansible-playbook", "-i", fleet, "-e", f"ansible_port={NOTHING_LISTENS}", "rosops.fleet.status")
    assert done.returncode == 0, done.stdout + done.stderr
    offline = re.findall(r"^ *[x!] host (\S+): offline: Failed to connect to the host via ssh", done.stdout, re.MULTILINE)
    assert offline == ["edge1", "robot1", "robot2"]
    assert "Traceback" not in done.stdout + done.stderr
    page = (elsewhere.directory / "reports" / "fleet-status.html").read_text("utf-8")
    assert all(name in page for name in offline)


def test_an_ansible_core_that_is_too_old_is_refused_first(elsewhere: Elsewhere) -> None:
    """AWX's own images have one. It could run much of the collection, and would report it wrongly."""
    (elsewhere.directory / "ansible.cfg").write_text("[defaults]\ncallbacks_enabled = rosops.fleet.fleet_report\n")
    inventory = elsewhere.collection / "inventories" / "example"
    done = elsewhere.run(
        "ansible-playbook", "-i", inventory, "rosops.fleet.update", python=os.environ["ROSOPS_OLD_PYTHON"]
    )
    assert done.returncode == 2, done.stdout + done.stderr
    assert re.search(r"This is ansible-core 2\.16\.\d+; rosops\.fleet needs 2\.19", done.stdout)
    assert re.findall(r"^TASK \[(.*?)\]", done.stdout, re.MULTILINE) == ["See that ansible-core is new enough"]
    assert "fleet_report" not in done.stdout + done.stderr  # neither a report nor an error of it
