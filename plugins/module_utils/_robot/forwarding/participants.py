# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Who takes part in an action, by the master's word."""

from __future__ import annotations

from ..._ros.registrar import Registrar


class Participants:
    """Clients, whoever cancels, whoever publishes a status, and whole servers: name -> address, each."""

    def __init__(self, action: str, ros: Registrar, own: str) -> None:
        state = ros.state()
        published, subscribed = state.publishers, state.subscribers
        names = {part: published.get(f"{action}/{part}", ()) for part in ("goal", "cancel", "status")}
        everyone = sorted({name for found in names.values() for name in found} - {own})
        uris = ros.addresses(everyone)[0]
        self.clients, self.cancellers, self.status = (
            {name: uris[name] for name in names[part] if name in uris} for part in ("goal", "cancel", "status")
        )
        whole = set(subscribed.get(f"{action}/goal", ())) & set(subscribed.get(f"{action}/cancel", ()))
        self.servers = {name: uri for name, uri in self.status.items() if name in whole}
        self.listed = own in published.get(f"{action}/goal", ())
        self.hears = {
            topic: set(subscribed.get(topic, ())) & set(self.clients)
            for topic in (f"{action}/result", f"{action}/status")
        }
