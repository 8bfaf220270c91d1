# SPDX-License-Identifier: GPL-3.0-or-later
"""What the repository of one fleet holds, of a checkout and of an installed collection."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import pytest
import yaml
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import FleetError
from ansible_collections.rosops.fleet.plugins.plugin_utils._repository.contents import (
    EXAMPLE_FLEETS,
    Change,
    contents,
    fleet_name,
    plan,
    read,
    write,
)

CHECKOUT = Path(__file__).resolve().parents[5]
WANTED = {"a/b.yml": "1\n", "c": "2\n", "d": "3\n"}


@pytest.fixture
def installed(tmp_path: Path) -> Path:
    """The collection as `ansible-galaxy collection install` leaves it."""
    for name in ("playbooks", "inventories", "meta"):
        shutil.copytree(CHECKOUT / name, tmp_path / name)
    for path in CHECKOUT.glob("*.yml"):
        if path.name != "galaxy.yml":
            shutil.copy(path, tmp_path)
    (tmp_path / "MANIFEST.json").write_text(json.dumps({"collection_info": {"version": "7.8.9"}}))
    return tmp_path


def test_the_version_is_the_one_that_is_installed(installed: Path) -> None:
    [needed] = yaml.safe_load(contents(installed, "x")["collections/requirements.yml"])["collections"]
    assert needed == {"name": "rosops.fleet", "version": "7.8.9"}
    [needed] = yaml.safe_load(contents(CHECKOUT, "x")["collections/requirements.yml"])["collections"]
    assert needed["version"] == yaml.safe_load((CHECKOUT / "galaxy.yml").read_text("utf-8"))["version"]


def packages(text: str) -> dict[str, str]:
    """Name -> version, of a file in which each has sums."""
    lines = text.replace(" \\\n", " ").splitlines()
    found = [
        re.fullmatch(r"([a-z0-9-]+)==([\d.]+)( ; .*?)?( +--hash=sha256:[0-9a-f]{64})+", line) for line in lines[1:]
    ]
    assert all(found), [line[:80] for line, one in zip(lines[1:], found, strict=True) if not one]
    return {one[1]: one[2] for one in found if one}


def test_python_packages_are_those_of_an_execution_environment_and_ansible_itself() -> None:
    """In the versions with which the project is tested. Where they are not: tools/lock.py."""
    control, more = (packages(contents(CHECKOUT, "x")[f"requirements{name}.txt"]) for name in ("", "-test"))
    assert not set(control) & set(more)
    pinned = dict(re.findall(r"^([a-z0-9-]+)==(\S+)", (CHECKOUT / "requirements.txt").read_text("utf-8"), re.MULTILINE))
    of_environment = (CHECKOUT / "meta" / "ee-requirements.txt").read_text("utf-8").split()
    assert {"ansible-core", *(line.partition(">")[0] for line in of_environment)} <= set(control)
    assert {"ansible-lint", "molecule", "yamllint"} <= set(more)
    both = control | more
    assert {name: both[name] for name in pinned if name in both} == {
        name: version for name, version in pinned.items() if name in both
    }


def test_hidden_files_are_hidden_there_and_the_name_is_put_in() -> None:
    found = contents(CHECKOUT, "mine")
    assert {".gitignore", ".gitlab-ci.yml", ".github/workflows/fleet.yml"} < set(found)
    assert [path for path in found if "dot-" in path] == []
    assert yaml.safe_load(found["inventory/group_vars/all.yml"]) == {"fleet_name": "mine"}
    assert "@fleet@" not in "".join(found.values())


def test_another_example_is_laid_over_the_first() -> None:
    talker, launch = (contents(CHECKOUT, "mine", example) for example in EXAMPLE_FLEETS)
    assert {"secrets.yml", "images/base/Dockerfile", "images/base/base.launch"} == {
        path for path in set(launch) - set(talker) if not path.endswith((".py", "package.xml"))
    }
    fleet, robots = (f"inventory/group_vars/{name}.yml" for name in ("all", "robots"))
    following = "molecule/update/vars/next.yml"
    assert {path for path, text in talker.items() if launch[path] != text} == {fleet, robots, following}
    assert yaml.safe_load(launch[fleet])["fleet_name"] == "mine"
    given = yaml.safe_load(launch[robots])
    assert set(yaml.safe_load(launch[following])) <= set(given), "what is next is a variable of the inventory"
    base, monitor = given["ros_apps"]
    assert f"images/{base['launch']['package']}/{base['launch']['file']}" in launch
    secrets = {item["secret"] for item in monitor["env"].values()}
    assert [name for name in secrets if f"name: {name}," not in launch["secrets.yml"]] == []


@pytest.mark.parametrize(
    ("directory", "name"),
    [
        ("my-fleet", "my-fleet"),
        ("My_Fleet 2", "my-fleet-2"),
        ("-a-", "a"),
        ("Flöte", "fl-te"),
        ("___", "fleet"),
        ("a" * 70, "a" * 63),
        ("a" * 62 + "_b", "a" * 62),
    ],
)
def test_a_directory_s_name_is_made_a_fleet_s(directory: str, name: str) -> None:
    assert fleet_name(directory) == name


def test_a_file_that_is_no_text_differs(tmp_path: Path) -> None:
    (tmp_path / "c").write_bytes(b"\xff")
    assert plan(WANTED, read(tmp_path, WANTED), force=False)[1] == ["c"]


def test_what_is_in_the_way_is_named(tmp_path: Path) -> None:
    (tmp_path / "c").mkdir()
    with pytest.raises(FleetError, match=r"/c: Is a directory\. Move it out of the way"):
        read(tmp_path, WANTED)
    (tmp_path / "a").write_text("")
    with pytest.raises(FleetError, match=r"/a(/b\.yml)?: (File exists|Not a directory)"):
        write(tmp_path, [Change("a/b.yml", None, "1\n")])


def test_a_link_that_leads_nowhere_is_not_followed(tmp_path: Path) -> None:
    (tmp_path / "c").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(FleetError, match="/c: No such file"):
        read(tmp_path, WANTED)
