# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The seam for another kind of ROS: who knows ROS 1's protocol, and who knows the answers alone."""

from __future__ import annotations

import inspect

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._ros import backend
from ansible_collections.rosops.fleet.plugins.module_utils._ros.backend import Backend
from ansible_collections.rosops.fleet.plugins.module_utils._ros.client import Ros1Client
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.code_files import MODULE_UTILS, relative_imports
from ansible_collections.rosops.fleet.tests.unit.plugins.pod_graph import World

ANSWERS = {"graph", "graph_json", "names", "conditions", "checks", "contract", "gate", "backend"}


@pytest.mark.parametrize("name", [*sorted(f"_ros.{name}" for name in ANSWERS), "_pod.judge"])
def test_what_knows_the_answers_alone_imports_no_protocol(name: str) -> None:
    text = (MODULE_UTILS / f"{name.replace('.', '/')}.py").read_text("utf-8")
    below = {found for found in relative_imports(name, text) if not found.startswith("_common.")}
    assert below <= {f"_ros.{known}" for known in ANSWERS}


@pytest.mark.parametrize("kind", [Ros1Client, World])
def test_a_backend_answers_all_that_is_asked(kind: type) -> None:
    """The client's and the tests' own; mypy looks at the types."""
    asked = {name: one for name, one in vars(Backend).items() if inspect.isfunction(one) and not name.startswith("_")}
    assert set(asked) == {"state", "ask", "handshakes", "rates"}
    for name, one in asked.items():
        assert list(inspect.signature(getattr(kind, name)).parameters) == list(inspect.signature(one).parameters)
    assert "client.Ros1Client" in str(backend.__doc__)
