# SPDX-License-Identifier: GPL-3.0-or-later
"""For the role observability: the images that the chosen profile needs."""

from __future__ import annotations

from ..module_utils._common.documents import Arguments, Result, Variables
from ..plugin_utils._action.base import FleetAction
from ..plugin_utils._observability.spec import images, spec_of


class ActionModule(FleetAction):
    _requires_connection = False

    def work(self, _params: Arguments, known: Variables) -> Result:
        spec = spec_of(self.variables(known, "observability"))
        return {"changed": False, "images": images(spec), "_ansible_verbose_always": True}
