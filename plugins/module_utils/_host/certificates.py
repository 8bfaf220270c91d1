# SPDX-License-Identifier: GPL-3.0-or-later
"""The certificates that a host's k3s renews, with their keys, and when they end. Its authorities' are none of them."""

from __future__ import annotations

import base64
import re
from datetime import datetime

from .k3s import DATA_DIR, Host

PLACES = ("agent", "server/tls", "server/tls/etcd")
KUBELET_KEY = f"{DATA_DIR}/agent/client-kubelet.key"  # another one only after a rotation
# the key of tokens of service accounts is no certificate's
STAYS = re.compile(r"-ca(\.nochain)?\.(crt|key)$|/service\.key$")
FIRST = re.compile(r"-----BEGIN CERTIFICATE-----([A-Za-z0-9+/=\s]+)-----END CERTIFICATE-----")
# Validity in X.509 (RFC 5280): two times, with two digits for a year until 2049 and four from then on.
TIME = rb"(?:\x17\x0d|\x18\x0f)((?:[0-9]{2})?[0-9]{12})Z"
VALIDITY = re.compile(TIME + TIME)


def renewable(host: Host) -> list[str]:
    """Paths of what `k3s certificate rotate` takes away, so that the next start makes it anew."""
    names = [f"{DATA_DIR}/{place}/{name}" for place in PLACES for name in host.names(f"{DATA_DIR}/{place}")]
    return [name for name in names if name.endswith((".crt", ".key")) and not STAYS.search(name)]


def end_of(pem: str) -> str:
    """When the first certificate of a file ends, as 2027-11-26T08:00:00; empty for what is none."""
    first = FIRST.search(pem)
    try:
        found = VALIDITY.search(base64.b64decode(first.group(1))) if first else None
        return datetime.strptime(f"20{found.group(2).decode()}"[-14:], "%Y%m%d%H%M%S").isoformat() if found else ""
    except ValueError:  # no base64, no date
        return ""
