# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The variables in the roles' READMEs come from their argument_specs, and are up to date."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).resolve().parents[3]
SPEC = importlib.util.spec_from_file_location("role_docs", CHECKOUT / "tests" / "tools" / "role_docs.py")
assert SPEC is not None
assert SPEC.loader is not None
role_docs = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(role_docs)

ARGUMENTS = """
argument_specs:
  main:
    short_description: One
    options:
      volumes:
        description: [All of them., "See P(rosops.fleet.other#filter) or V(none)."]
        type: list
        elements: dict
        default: []
        options:
          name:
            description: Its name.
            type: str
            required: true
          mode:
            description: a | b
            choices: [a, b]
            default: a
      empty:
        description: Nothing.
        type: str
        default: ""
  ready:
    short_description: Wait for C(all) of it
"""

TABLE = """| variable | type | default | |
|---|---|---|---|
| `volumes` | list of dict | `[]` | All of them. See `rosops.fleet.other` or `none`. |
| `volumes[].name` | str | required | Its name. |
| `volumes[].mode` | str | `a` | a \\| b One of `a`, `b`. |
| `empty` | str | `""` | Nothing. |

Entry point `ready` (`tasks_from: ready`): Wait for `all` of it.

No variables.
"""


@pytest.fixture
def roles(tmp_path: Path) -> Path:
    (tmp_path / "one" / "meta").mkdir(parents=True)
    (tmp_path / "one" / "meta" / "argument_specs.yml").write_text(ARGUMENTS, encoding="utf-8")
    (tmp_path / "one" / "README.md").write_text("# one\n\nText.\n", encoding="utf-8")
    return tmp_path


def test_a_readme_without_markers_gets_a_section(roles: Path, capsys: pytest.CaptureFixture[str]) -> None:
    readme = roles / "one" / "README.md"
    assert role_docs.main(["--check"], roles) == 1
    assert "one: README.md is not up to date" in capsys.readouterr().out
    assert readme.read_text(encoding="utf-8") == "# one\n\nText.\n"
    assert role_docs.main([], roles) == 0
    text = readme.read_text(encoding="utf-8")
    assert text.startswith("# one\n\nText.\n\n## Variables\n\n" + role_docs.BEGIN)
    assert TABLE in text
    assert role_docs.main(["--check"], roles) == 0


def test_only_what_is_between_the_markers_is_changed(roles: Path) -> None:
    readme = roles / "one" / "README.md"
    readme.write_text(f"# one\n{role_docs.BEGIN}\nold\n{role_docs.END}\n\n## After\n", encoding="utf-8")
    assert role_docs.main([], roles) == 0
    text = readme.read_text(encoding="utf-8")
    assert "old" not in text
    assert text.startswith("# one\n")
    assert text.endswith("\n\n## After\n")


@pytest.mark.parametrize("markers", ["BEGIN", "END", "END BEGIN", "BEGIN END BEGIN"])
def test_broken_markers_are_an_error(roles: Path, markers: str, capsys: pytest.CaptureFixture[str]) -> None:
    words = {"BEGIN": role_docs.BEGIN, "END": role_docs.END}
    (roles / "one" / "README.md").write_text("\n".join(words[word] for word in markers.split()), encoding="utf-8")
    assert role_docs.main([], roles) == 1
    assert "one: needs one <!-- BEGIN variables -->" in capsys.readouterr().err


def test_a_role_without_readme_is_an_error(roles: Path) -> None:
    (roles / "one" / "README.md").unlink()
    assert role_docs.main([], roles) == 1


def test_the_collection_s_roles_are_up_to_date() -> None:
    assert role_docs.main(["--check"]) == 0
