# SPDX-License-Identifier: GPL-3.0-or-later
"""`make dashboards`."""

import sys

from .build import main

sys.exit(main())
