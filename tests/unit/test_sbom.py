# SPDX-License-Identifier: GPL-3.0-or-later
"""The list of what a release needs: `tools/sbom.py`."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import yaml

CHECKOUT = Path(__file__).resolve().parents[2]


def test_it_has_all_that_a_fleet_runs_on_with_the_versions_that_were_tested() -> None:
    told = subprocess.run([sys.executable, CHECKOUT / "tools" / "sbom.py"], capture_output=True, text=True, check=True)  # noqa: S603 - our own
    bill = json.loads(told.stdout)
    galaxy = yaml.safe_load((CHECKOUT / "galaxy.yml").read_text("utf-8"))
    assert (bill["bomFormat"], bill["metadata"]["component"]["version"]) == ("CycloneDX", galaxy["version"])
    found = {one["name"]: one["version"] for one in bill["components"]}
    assert galaxy["dependencies"].keys() <= found.keys()
    pinned = (CHECKOUT / "requirements.txt").read_text("utf-8").splitlines()
    assert all(f"{name}=={found[name]}" in pinned for name in ("ansible-core", "kubernetes"))
    k3s = yaml.safe_load((CHECKOUT / "roles" / "k3s" / "defaults" / "main.yml").read_text("utf-8"))
    assert (found["k3s"], found["ros"]) == (k3s["k3s_version"], "noetic-ros-core")
    assert {"prom/prometheus", "grafana/loki", "victoriametrics/vmagent"} <= found.keys()
    assert len({one["bom-ref"] for one in bill["components"]}) == len(bill["components"])
