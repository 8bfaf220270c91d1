# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""XML-RPC of peers that may be hostile."""

from __future__ import annotations

import datetime
import re
import xmlrpc.client
from pathlib import Path

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import RosError
from ansible_collections.rosops.fleet.plugins.module_utils._ros import bodies
from ansible_collections.rosops.fleet.plugins.module_utils._ros.bodies import loads

PLUGINS = Path(bodies.__file__).parents[2]
VALUES = ["<a & b>", "ä", "", -(2**31), 2**31 - 1, 1.5, True, None, [1, ["x", []]], {"a": {"b": [1]}, "c": {}}]
DOCTYPES = [
    '<!DOCTYPE x [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;">]>',
    '<!DOCTYPE x SYSTEM "file:///etc/passwd">',
    "<!DOCTYPE x>",
    '<!DOCTYPE x [<!ENTITY % p SYSTEM "http://10.0.0.1/x"> %p;]>',
]


def test_it_reads_what_the_library_reads() -> None:
    for values in (
        tuple(VALUES),
        (xmlrpc.client.Binary(b"\0x"), xmlrpc.client.DateTime(datetime.datetime(2026, 1, 2))),
    ):
        call = xmlrpc.client.dumps(values, "twice", allow_none=True).encode()
        assert loads(call) == xmlrpc.client.loads(call) == (values, "twice")
    reply = xmlrpc.client.dumps((VALUES,), methodresponse=True, allow_none=True).encode()
    assert loads(reply) == xmlrpc.client.loads(reply)
    with pytest.raises(xmlrpc.client.Fault, match="no"):
        loads(xmlrpc.client.dumps(xmlrpc.client.Fault(1, "no")).encode())
    long = b"<params><param><value><i8>-9223372036854775808</i8></value></param></params>"
    assert loads(long) == ((-(2**63),), None)


@pytest.mark.parametrize("doctype", DOCTYPES)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_a_document_type_is_refused(doctype: str, encoding: str) -> None:
    text = f'<?xml version="1.0" encoding="{encoding}"?>{doctype}<params><param><value>x</value></param></params>'
    with pytest.raises(RosError, match="document type or entities"):
        loads(text.encode(encoding))


@pytest.mark.parametrize("tag", ["i1", "i2", "i4", "i8", "int", "biginteger", "x:int"])
def test_a_number_ends(tag: str) -> None:
    with pytest.raises(RosError, match="more than 20 digits"):
        loads(f"<params xmlns:x='x'><param><value><{tag}>{'7' * 21}</{tag}></value></param></params>".encode())


def test_nobody_else_parses_xml_of_peers() -> None:
    """`launch_file` reads what a user wrote, on the control node, and refuses entities in words of its own."""
    parsing = re.compile(r"xmlrpc\.client\.(loads|getparser|ServerProxy)|\bexpat\b|ElementTree|minidom|xml\.sax")
    found = {
        str(file.relative_to(PLUGINS)) for file in PLUGINS.rglob("*.py") if parsing.search(file.read_text("utf-8"))
    }
    own_container = "plugin_utils/_objects/master.py"  # the probe of the master asks the master beside it
    assert found == {"module_utils/_ros/bodies.py", "plugin_utils/_validate/launch_file.py", own_container}
