# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects against the API's own schemas. kubernetes_validate reads all of these for each object; here once."""

from __future__ import annotations

import functools
from typing import Any

from kubernetes_validate import utils

utils.schema_contents = functools.cache(utils.schema_contents)


def fits_the_api(item: dict[str, Any]) -> None:
    """ValidationError where it does not."""
    utils.validate(item, "1.34", strict=True)
