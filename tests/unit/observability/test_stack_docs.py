# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The page about observability, and the dissertation's keys in defaults, argument spec and validation."""

from __future__ import annotations

import importlib.util
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.keys import Kind
from ansible_collections.rosops.fleet.plugins.plugin_utils._validate.schema import variables

CHECKOUT = Path(__file__).resolve().parents[3]
TOOL = CHECKOUT / "tests" / "tools" / "observability_docs.py"


def _tool() -> Any:
    spec = importlib.util.spec_from_file_location("observability_docs", TOOL)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


tool = _tool()
ROLE: dict[str, Any] = yaml.safe_load(tool.DEFAULTS.read_text("utf-8"))


def leaves(kind: Kind, path: str) -> list[str]:
    """The keys of a mapping that are no mappings themselves."""
    if not isinstance(kind.inner, Mapping):
        return [path]
    return [leaf for name, key in kind.inner.items() for leaf in leaves(key.kind, f"{path}.{name}")]


def test_the_page_is_up_to_date() -> None:
    assert tool.main(["--check"]) == 0


def test_every_key_of_the_dissertation_has_its_variable() -> None:
    assert set(tool.keys(ROLE)) == set(leaves(variables()["observability"], "observability"))
