# SPDX-License-Identifier: GPL-3.0-or-later
"""The source of the dashboards that the role observability brings along: `make dashboards` writes their JSON anew.

`build` puts them together, a module per page holds its panels, `panels` and `page` hold what pages share, `queries` and
`lint` are what tests look at them with.
"""
