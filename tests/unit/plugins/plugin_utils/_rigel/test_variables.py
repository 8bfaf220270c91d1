# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Variables of Rigelfiles: filled in as Rigel does it, and templates of Ansible's in the inventory."""

from __future__ import annotations

from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.plugin_utils._rigel.variables import Filled, Variables, Verbatim

DECLARED = {"image": "arm:1", "rate": 5, "list": ["{{ vars.image }}", 2], "a": "x{{ vars.b }}", "b": "y", "my-var": "z"}


def filled(value: Any, **environment: str) -> tuple[Any, Variables]:
    variables = Variables(DECLARED, environment)
    return variables.filled(value, "jobs.x"), variables


@pytest.mark.parametrize(
    ("given", "value", "template"),
    [
        ("{{ vars.image }}", "arm:1", "{{ rigel_image }}"),
        ("{{vars.image}}", "arm:1", "{{ rigel_image }}"),
        ("x/{{ vars.image }}-{{ vars.b }}", "x/arm:1-y", "x/{{ rigel_image }}-{{ rigel_b }}"),
        ("{{ vars.a }}", "xy", "{{ rigel_a }}"),
        ("{{ vars.my-var }}", "z", "{{ rigel_my_var }}"),
        ("p{{ vars.rate }}", "p5", "p5"),
        ("{{ vars.image | upper }}", "{{ vars.image | upper }}", "{{ rigel_image | upper }}"),
        ("{{ vars.HOST_PATH }}/x", "/srv/x", "{{ rigel_HOST_PATH }}/x"),
    ],
)
def test_texts(given: str, value: str, template: str) -> None:
    found, _ = filled(given, HOST_PATH="/srv")
    assert isinstance(found, Filled)
    assert (found, found.template) == (value, template)


def test_numbers_and_lists_keep_their_types() -> None:
    found, variables = filled({"{{ vars.b }}": "{{ vars.rate }}", "l": "{{ vars.list }}", "n": 3})
    assert found == {"y": 5, "l": ["arm:1", 2], "n": 3}
    assert variables.read == {"b", "rate", "list", "image"}


@pytest.mark.parametrize("given", ["{{ $value }}", "{% if x %}", "{{ vars.image }} {{ $labels.pod }}"])
def test_braces_of_others_are_not_for_ansible(given: str) -> None:
    found, _ = filled(given)
    assert isinstance(found, Verbatim)
    assert found == given.replace("{{ vars.image }}", "arm:1")


def test_the_environments_value_stays_there() -> None:
    found, variables = filled("{{ vars.KEY }}", KEY="hunter2")
    assert found == "hunter2"
    assert variables.used["KEY"].value.template == "{{ lookup('ansible.builtin.env', 'KEY', default=undef()) }}"


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("{{ vars.none }}", "jobs.x: vars.none is neither under vars nor in the environment"),
        ("{{ data.image }}", "jobs.x: {{ data.image }} is made by another job"),
        ("{{ image }}", r"jobs.x: {{ image }} is no variable of Rigel's; allowed"),
        ("p{{ vars.list }}", "jobs.x: vars.list is no text that could stand within one"),
    ],
)
def test_what_rigel_refuses(given: str, said: str) -> None:
    with pytest.raises(SpecError) as error:
        filled(given)
    assert str(error.value).startswith(said)


def test_a_variable_made_of_itself() -> None:
    with pytest.raises(SpecError, match=r"vars\.a: is made of itself .a -> b -> a."):
        Variables({"a": "{{ vars.b }}", "b": "{{ vars.a }}"}, {}).filled("{{ vars.a }}", "jobs.x")
