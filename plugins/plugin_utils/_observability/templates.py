# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The templates beside this file: pods and programs' configurations as YAML. Pure, but that the files are read."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import yaml
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

Config = dict[str, Any]  # of a program, as that wants it


class _Plain(yaml.SafeDumper):
    """Without anchors."""

    def ignore_aliases(self, data: Any) -> bool:  # noqa: ARG002 - PyYAML's signature
        return True


def filled(name: str, **values: Any) -> Config:
    """The template of this name. What stands in `{{ }}` becomes one value, written as JSON, which is YAML, too."""
    environment = Environment(
        loader=FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=StrictUndefined,
        finalize=lambda value: Markup(json.dumps(value)),  # noqa: S704 - no markup: nothing in it is to be escaped
        trim_blocks=True,
        lstrip_blocks=True,
    )
    found: Config = yaml.safe_load(environment.get_template(f"{name}.yml.j2").render(values))
    return found


def yaml_text(value: Config) -> str:
    """A configuration file's text, that people can read: the same bytes for the same value, keys in the order given."""
    # Ansible's texts carry tags, which a dumper does not know
    plain = json.loads(json.dumps(value))
    text: str = yaml.dump(plain, Dumper=_Plain, sort_keys=False, width=1000, allow_unicode=True)
    return text
