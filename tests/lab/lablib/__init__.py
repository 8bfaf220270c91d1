# SPDX-License-Identifier: GPL-3.0-or-later
"""The lab: systemd hosts in containers, their images, and a k3s to put on them."""
