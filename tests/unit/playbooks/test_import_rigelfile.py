# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Rigelfiles in, fleets out, by ansible-playbook itself: three of them pass the validation; what is there stays."""

from __future__ import annotations

from pathlib import Path

import yaml
from ansible_collections.rosops.fleet.tests.unit.playbooks.control_node import CHECKOUT, Control

WHOLE = CHECKOUT / "tests" / "unit" / "fixtures" / "rigel"
IMPORT = f"- import_playbook: {CHECKOUT}/playbooks/import_rigelfile.yml\n"


def imports(
    control: Control, source: Path | str, *arguments: str, dest: str = "arms", **environ: str
) -> tuple[int, str]:
    control.write("play.yml", IMPORT)
    done = control.run("-e", f"rigelfile={source}", "-e", f"dest={dest}", *arguments, **environ)
    print(done.stdout + done.stderr)
    return done.returncode, done.stdout + done.stderr


def texts(folder: Path) -> dict[str, str]:
    return {str(path.relative_to(folder)): path.read_text() for path in folder.rglob("*") if path.is_file()}


def test_what_was_imported_passes_the_validation(control: Control) -> None:
    names = ["pubsub", "service", "action"]
    task = {
        "rosops.fleet.rigelfile_import": {"src": f"{WHOLE}/{{{{ item }}}}/Rigelfile", "dest": "{{ item }}"},
        "loop": names,
    }
    control.write("play.yml", yaml.safe_dump([{"hosts": "localhost", "gather_facts": False, "tasks": [task]}]))
    done = control.run()
    assert done.returncode == 0, done.stdout + done.stderr
    shown = {"ansible.builtin.debug": {"msg": "{{ fleet.robots.robot1.apps | map(attribute='image') | list }}"}}
    plays = [{"import_playbook": f"{CHECKOUT}/playbooks/validate.yml"}]
    control.write("play.yml", yaml.safe_dump([*plays, {"hosts": "robots", "gather_facts": False, "tasks": [shown]}]))
    for name in names:
        (control.folder / "hosts.yml").unlink()
        (control.folder / "hosts.yml").symlink_to(f"{name}/inventory")
        valid = control.run()
        assert valid.returncode == 0, valid.stdout + valid.stderr
        assert "registry.example.org/" in valid.stdout  # the variables are filled in there


def test_a_second_import_changes_nothing_and_one_that_would_overwrite_is_refused(
    control: Control, tmp_path: Path
) -> None:
    source = WHOLE / "pubsub" / "Rigelfile"
    status, output = imports(control, source, "--check", "--diff")
    assert (status, "+fleet_name: arms" in output) == (0, True)
    assert not (tmp_path / "arms").exists()
    assert imports(control, source)[0] == 0
    before = texts(tmp_path / "arms")
    assert {*before} == {
        "IMPORT.md",
        *(f"inventory/{name}" for name in ("hosts.yml", "group_vars/all.yml", "group_vars/robots.yml")),
    }
    assert "rigel-admin" not in str(before) + output
    hosts = tmp_path / "arms" / "inventory" / "hosts.yml"
    hosts.write_text(hosts.read_text().replace("192.0.2.21", "192.0.2.77"))
    (tmp_path / "arms" / "IMPORT.md").unlink()
    status, output = imports(control, source)
    assert status == 2
    assert "arms has inventory/hosts.yml with another text" in output
    assert not (tmp_path / "arms" / "IMPORT.md").exists()
    assert "192.0.2.77" in hosts.read_text()
    assert imports(control, source, "-e", "force=yes")[0] == 0
    assert texts(tmp_path / "arms") == before
    assert "changed=0" in imports(control, source)[1]


def test_errors_say_file_and_line_and_write_nothing(control: Control, tmp_path: Path) -> None:
    control.write("Rigelfile", "jobs:\n  deploy_k8s:\n    with: [\n")
    status, output = imports(control, "Rigelfile")
    assert (status, "Rigelfile:4:1: is no YAML" in output) == (2, True)
    assert not (tmp_path / "arms").exists()


def test_dashboards_and_the_environments_values(control: Control, tmp_path: Path) -> None:
    given = yaml.safe_load((WHOLE / "pubsub" / "Rigelfile").read_text())
    params = given["jobs"]["deploy_k8s"]["with"]["orchestration"]["additional_k8s_params"]
    params["observability"] = {"grafana": {"dashboards": ["graphs/arm.json"]}}
    params["application"]["spec"]["template"]["spec"]["containers"][0]["env"] += [
        {"name": "KEY", "value": "{{ vars.ARM_KEY }}"},
        {"name": "TEMPLATE", "value": "{{ $labels.pod }}"},
    ]
    control.write("Rigelfile", yaml.safe_dump(given))
    assert "graphs/arm.json: cannot be read" in imports(control, "Rigelfile", ARM_KEY="hunter2")[1]
    (tmp_path / "graphs").mkdir()
    control.write("graphs/arm.json", '{"title": "Arm"}')
    status, output = imports(control, "Rigelfile", ARM_KEY="hunter2")
    assert status == 0, output
    made = texts(tmp_path / "arms")
    assert made["dashboards/arm.json"] == '{"title": "Arm"}'
    assert "hunter2" not in str(made)
    assert 'TEMPLATE: !unsafe "{{ $labels.pod }}"' in made["inventory/group_vars/robots.yml"]
