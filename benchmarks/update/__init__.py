# SPDX-License-Identifier: GPL-3.0-or-later
"""The experiment of `make bench`: updates of real ROS applications, by this collection and by plain Kubernetes."""
