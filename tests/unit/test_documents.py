# SPDX-License-Identifier: GPL-3.0-or-later
"""What README, docs and the roles' READMEs show as code: YAML that is a fleet or a play, commands that there are."""

from __future__ import annotations

import functools
import itertools
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest
import yaml
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.merge import LAYERS
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.parts import PARTS
from ansible_collections.rosops.fleet.plugins.plugin_utils._validate.fleet import check_fleet
from ansible_collections.rosops.fleet.plugins.plugin_utils._validate.schema import variables
from doc_blocks import CHECKOUT, PAGES, Block, blocks

EXAMPLE = CHECKOUT / "playbooks" / "files" / "examples" / "launch"  # of which first-fleet.md tells
FOR_HOSTS = re.compile(r"# (?:group|host)_vars/(\w+)\.yml")
# What an app has to have, where a page shows another part of it.
APP = {"name": "app", "image": "registry.example.org/app:1.0", "command": ["run"]}


YAML = [block for block in blocks() if block.is_yaml]
VARIABLES = [block for block in YAML if not block.text.startswith("- ")]
PLAYS = [block for block in YAML if block not in VARIABLES]
COMMANDS = [Block(block.where, line) for block in blocks() if block.is_shell for line in block.commands]


def apps_before(block: Block) -> dict[str, Any]:
    """What its page said last, above it, of the fleet's apps and of layers over them."""
    page = block.where.split(":")[0]
    above = VARIABLES[: VARIABLES.index(block)]
    said = [item for other in above if other.where.split(":")[0] == page for item in other.value.items()]
    return {name: value for name, value in said if name in ("ros_apps", *LAYERS)}


def fleet_of(block: Block) -> dict[str, Any]:
    """The block as the inventory of a fleet that has everything else."""
    value = dict(block.value)
    if "all" in value:
        children = value["all"]["children"]
        groups = {name: list(group["hosts"]) for name, group in children.items()}
        return {"groups": groups, "hosts": {}}
    known = variables()
    if not set(value) & set(known):
        value = {"ros_apps": [value]}  # a part of an app
    if set(value) & set(LAYERS):  # over what the page said before
        value = {**apps_before(block), **value}
    value = {name: item for name, item in value.items() if not (isinstance(item, str) and item.startswith("{{"))}
    if "ros_apps" in value:
        value["ros_apps"] = [{**APP, **app} for app in value["ros_apps"]]
    where = FOR_HOSTS.search(block.text)
    on = {"all": ("edge1", "robot1"), "edge": ("edge1",)}.get(where[1] if where else "", ("robot1",))
    return {"groups": {"edge": ["edge1"], "robots": ["robot1"]}, "hosts": dict.fromkeys(on, value)}


@pytest.mark.parametrize("block", VARIABLES, ids=lambda block: block.where)
def test_variables_are_a_fleet_s(block: Block) -> None:
    assert [problem.line() for problem in check_fleet(**fleet_of(block)).problems] == []


def test_plays_and_tasks_are_ansible_s(tmp_path: Path) -> None:
    files = []
    for number, block in enumerate(PLAYS):
        value = block.value
        is_play = any({"hosts", "import_playbook", "ansible.builtin.import_playbook"} & set(item) for item in value)
        roles = [role for item in value for role in item.get("roles", ()) if isinstance(role, dict)]
        # Ansible takes a key that it does not know for a variable, and plays all of the role
        assert [key for role in roles for key in role if key not in ("role", "vars")] == [], block.where
        files.append(tmp_path / f"{number}.yml")
        files[-1].write_text(yaml.safe_dump(value if is_play else [{"hosts": "all", "tasks": value}]))
    kept = {key: value for key, value in os.environ.items() if not key.startswith("ANSIBLE_")}
    environ = {
        **kept,
        "ANSIBLE_COLLECTIONS_PATH": str(CHECKOUT / ".ansible" / "collections"),
        "ANSIBLE_HOME": str(tmp_path / "home"),
    }
    program = str(Path(sys.executable).parent / "ansible-playbook")
    found = subprocess.run(  # noqa: S603 - our own
        [program, "--syntax-check", "-i", "edge1,", *map(str, files)],
        env=environ, capture_output=True, text=True, check=False, timeout=120,
    )  # fmt: skip
    assert found.returncode == 0, found.stderr


# --- commands ---------------------------------------------------------------------------------------------------------


@functools.cache
def _declared() -> str:
    """Where whatever can be given with -e stands: in a role's specification or in a playbook."""
    files = [*CHECKOUT.glob("roles/*/meta/argument_specs.yml"), *CHECKOUT.glob("playbooks/**/*.yml")]
    return "\n".join(path.read_text("utf-8") for path in files)


def _tags(value: Any) -> Iterator[str]:
    if isinstance(value, Mapping):
        tags = value.get("tags", [])
        yield from [tags] if isinstance(tags, str) else tags
        value = list(value.values())
    for item in value if isinstance(value, list) else ():
        yield from _tags(item)


@functools.cache
def _known_tags() -> frozenset[str]:
    plays = [yaml.safe_load(path.read_text("utf-8")) for path in CHECKOUT.glob("playbooks/**/*.yml")]
    return frozenset({*PARTS, *(tag for play in plays for tag in _tags(play))})


def _options(words: list[str], *names: str) -> list[str]:
    return [word for before, word in itertools.pairwise(words) if before in names]


@pytest.mark.parametrize(
    "command",
    [one for one in COMMANDS if one.text.startswith("ansible-playbook ")],
    ids=lambda one: f"{one.where} {one.text.partition('  ')[0]}",
)
def test_playbooks_tags_and_variables_of_commands_are_there(command: Block) -> None:
    words = shlex.split(command.text, comments=True)
    [named] = [word for word in words[1:] if re.fullmatch(r"rosops\.fleet\.\w+|\w+\.yml", word)]
    ours = CHECKOUT / "playbooks" / f"{named.removeprefix('rosops.fleet.')}.yml"
    assert ours.is_file() or (EXAMPLE / named).is_file()
    assert {tag for given in _options(words, "--tags", "-t") for tag in given.split(",")} <= _known_tags()
    declared = _declared()
    for given in [one for one in _options(words, "-e") if not one.startswith("@")]:  # a file of somebody's own
        names = yaml.safe_load(given) if given.startswith("{") else [given.partition("=")[0]]
        assert [name for name in names if re.search(rf"\b{name}\b", declared)] == list(names)


def test_modules_and_targets_of_commands_are_there() -> None:
    words = [shlex.split(one.text, comments=True) for one in COMMANDS if one.text.startswith(("ansible ", "make "))]
    ours = {name for line in words for name in _options(line, "-m") if name.startswith("rosops.fleet.")}
    assert ours
    assert [name for name in ours if not (CHECKOUT / f"plugins/modules/{name.split('.')[2]}.py").is_file()] == []
    targets = {line[1] for line in words if line[0] == "make" and len(line) > 1}
    targets |= {name for page in PAGES for name in re.findall(r"`make ([a-z-]+)", page.read_text("utf-8"))}
    there = set(re.findall(r"^([a-z-]+):", (CHECKOUT / "Makefile").read_text("utf-8"), re.MULTILINE))
    assert targets - there == set()
