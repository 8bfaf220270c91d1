# SPDX-License-Identifier: GPL-3.0-or-later
"""What `ansible-galaxy collection build` takes of a checkout in which somebody works."""

from __future__ import annotations

import subprocess
import sys
import tarfile
from pathlib import Path

CHECKOUT = Path(__file__).resolve().parents[2]
# Names of files, with blanks between them.
TAKEN = """
    CHANGELOG.md LICENSE README.md SECURITY.md awx/job_templates.yml changelogs/config.yaml changelogs/changelog.yaml
    docs/updates.md docs/runbooks/x.md inventories/example/hosts.yml meta/runtime.yml guarded.yml rollback.yml
    site.yml status.yml update.yml validate.yml playbooks/files/examples/launch/images/base/Dockerfile
    playbooks/files/examples/launch/images/base/driver.py playbooks/files/repository/ansible.cfg
    playbooks/files/repository/dot-github/workflows/fleet.yml playbooks/files/repository/dot-gitignore
    playbooks/files/repository/molecule/update/molecule.yml playbooks/files/repository/requirements-test.txt
    playbooks/files/repository/requirements.txt
    playbooks/site.yml playbooks/vars/fleet.yml plugins/action/x.py plugins/callback/x.py plugins/modules/x.py
    plugins/module_utils/_ros/gate.py plugins/plugin_utils/_model/names.py awx/objects.yml roles/k3s/tasks/main.yml
    roles/observability/files/dashboards/fleet.json tests/sanity/ignore-2.19.txt
"""
LEFT = """
    CONTRIBUTING.md Makefile ansible.cfg constraints.txt pyproject.toml requirements.txt docs/developing.md
    execution-environment/execution-environment.yml .ansible/x .ansible-lint .cache/x .ci/run .git/config .gitignore
    .hypothesis/x .lab/x .mypy_cache/x .pre-commit-config.yaml .pytest_cache/x .ruff_cache/x .venv/bin/python
    .yamllint benchmarks/bench_site.py benchmarks/results/x.json inventories/lab/hosts.sh
    molecule/fleet/molecule.yml my-fleet/group_vars/all.yml my-fleet.yml plugins/action/__pycache__/x.pyc
    plugins/modules/__pycache__/x.pyc reports/x.json rosops-fleet-0.0.9.tar.gz tests/apps/x tests/lab/lab
    tests/run_stages.py tests/output/x tests/tools/x.py tests/unit/golden/x.yml tests/update/x.py
    tools/dashboards/x.py
"""


def test_the_package_holds_what_users_need_and_nothing_else(tmp_path: Path) -> None:
    tree = tmp_path / "checkout"
    for name in f"{TAKEN} {LEFT}".split():
        path = tree / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(name)
    (tree / "galaxy.yml").write_text((CHECKOUT / "galaxy.yml").read_text("utf-8"))
    words = ["galaxy", "collection", "build", "--output-path", str(tmp_path), str(tree)]
    subprocess.run([sys.executable, "-m", "ansible", *words], check=True, capture_output=True)  # noqa: S603
    [package] = tmp_path.glob("*.tar.gz")
    with tarfile.open(package) as archive:
        found = {one.name for one in archive.getmembers() if one.isfile()}
    assert found - {"MANIFEST.json", "FILES.json"} == set(TAKEN.split())


def test_of_every_name_in_the_checkout_it_is_said_whether_it_is_taken() -> None:
    names = {path.name for path in CHECKOUT.iterdir() if path.suffix != ".gz"}
    names |= {f"tests/{path.name}" for path in (CHECKOUT / "tests").iterdir() if path.name[0] == "s"}
    said = {
        part for name in f"{TAKEN} {LEFT}".split() for part in (name.partition("/")[0], "/".join(name.split("/")[:2]))
    }
    assert {name for name in names if name[0] != "." and name not in said} <= {"galaxy.yml"}
