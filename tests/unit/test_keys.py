# SPDX-License-Identifier: GPL-3.0-or-later
"""A key of an app is one entry of one table: it is read, refused and documented by that alone."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml
from ansible_collections.rosops.fleet.plugins.plugin_utils._model import app
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.finding import Problem
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.keys import kind_of, read
from ansible_collections.rosops.fleet.plugins.plugin_utils._validate.schema import value_problems
from imports import loaded

CHECKOUT = Path(__file__).resolve().parents[2]
KEY = '''
    wheels: Annotated[int, whole(2, 8)] = 4
    """How many wheels it turns.

    All of them are the robot's."""
'''
BEFORE = '    """The container image."""\n'


docs = loaded(CHECKOUT / "tools" / "docs" / "keys.py", "docs_keys")


@pytest.fixture(name="wider")
def wider_table(tmp_path: Path) -> Any:
    """The table with one entry more."""
    text = Path(app.__file__).read_text("utf-8")
    assert text.count(BEFORE) == 1
    path = tmp_path / "wider.py"
    path.write_text(text.replace(BEFORE, BEFORE + KEY), encoding="utf-8")
    return loaded(path, f"{app.__package__}.wider").App  # where its own imports lead


def problems(of: Any, **more: Any) -> list[Problem]:
    return value_problems({"name": "talker", "image": "i", **more}, kind_of(of), "app")


def test_a_new_key_is_read(wider: Any) -> None:
    assert read(wider, {"name": "talker", "image": "i", "wheels": 6}).wheels == 6
    assert read(wider, {"name": "talker", "image": "i"}).wheels == 4


def test_a_new_key_of_the_wrong_type_is_refused(wider: Any) -> None:
    assert problems(wider, wheels=6) == []
    allowed = "a whole number, 2 or more and 8 or less"
    assert problems(wider, wheels="six") == [Problem("app.wheels", "is 'six'", allowed)]
    assert problems(wider, wheels=9) == [Problem("app.wheels", "is the number 9", allowed)]
    [unknown] = problems(wider, weels=6)
    assert (unknown.path, unknown.problem) == ("app.weels", "is unknown; did you mean wheels?")
    assert "wheels" not in problems(app.App, weels=6)[0].allowed


def test_a_new_key_is_documented(wider: Any) -> None:
    spec = (CHECKOUT / "roles" / "ros_app" / "meta" / "argument_specs.yml").read_text("utf-8")
    before = yaml.safe_load(spec)["argument_specs"]["main"]["options"]["ros_apps"]["options"]
    after = yaml.safe_load(docs.rendered(spec, wider))["argument_specs"]["main"]["options"]["ros_apps"]["options"]
    words = ["How many wheels it turns.", "All of them are the robot's."]
    assert after == {**before, "wheels": {"description": words, "type": "int", "default": 4}}


@pytest.mark.parametrize("role", docs.TABLES)
def test_the_argument_specs_are_the_table_s(role: str) -> None:
    spec = (CHECKOUT / "roles" / role / "meta" / "argument_specs.yml").read_text("utf-8")
    assert spec == docs.rendered(spec, docs.TABLES[role]), "run python tools/docs/keys.py"
