# SPDX-License-Identifier: GPL-3.0-or-later
"""How values in an inventory must look: a test of each form and the words that tell an operator about it."""

from __future__ import annotations

import contextlib
import ipaddress
import re
from collections.abc import Callable
from decimal import Decimal
from typing import Any, NamedTuple
from urllib.parse import urlsplit
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

import yaml

from ...module_utils._common.errors import SpecError

_LABEL = r"[a-z0-9](?:[-a-z0-9]*[a-z0-9])?"
_SUBDOMAIN = rf"{_LABEL}(?:\.{_LABEL})*"
# Reference grammar: github.com/distribution/reference, file regexp.go
_IMAGE = re.compile(
    r"(?:[A-Za-z0-9](?:[-A-Za-z0-9.]*[A-Za-z0-9])?(?::[0-9]+)?/)?"
    r"[a-z0-9]+(?:(?:[._]|__|-+)[a-z0-9]+)*(?:/[a-z0-9]+(?:(?:[._]|__|-+)[a-z0-9]+)*)*"
    r"(?::(?P<tag>[A-Za-z0-9_][-A-Za-z0-9_.]{0,127}))?(?:@(?P<digest>[a-z0-9]+:[0-9a-f]{32,}))?"
)
_BLANK = re.compile(r"[\s\0-\x1f\x7f]")  # control characters, too
# Kubernetes API reference, "Quantity"
_QUANTITY = re.compile(r"(?P<number>[0-9]+(?:\.[0-9]+)?)(?P<suffix>[KMGTPE]i|[numkMGTPE]|[eE][+-]?[0-9]{1,2})?")
_SCALE = {suffix: Decimal(1024) ** power for power, suffix in enumerate(("", "Ki", "Mi", "Gi", "Ti", "Pi", "Ei"))}
_SCALE.update({suffix: Decimal(10) ** power for suffix, power in zip("numkMGTPE", (-9, -6, -3, 3, 6, 9, 12, 15, 18))})

# What a pod may see of its host. Everything else (/, /etc, /proc, /sys, /run, /var/lib/rancher, /var/lib/kubelet, ...)
# lets a container take the host over or break k3s.
_SAFE = re.compile(r"/(?:data|media|mnt|opt|srv)(?:/.*)?|/(?:dev|home|var/log)/.+")
PRIVATE_PARTS = (".ssh", ".kube", ".gnupg")
UNSAFE_DEVICES = ("/dev/mem", "/dev/kmem", "/dev/port")
HOST_PATHS = (
    "a path at or below /data, /media, /mnt, /opt or /srv, or below /dev, /home or /var/log, without '..', ':' or "
    f"blanks, and none of {', '.join((*UNSAFE_DEVICES, *PRIVATE_PARTS))}"
)


class Form(NamedTuple):
    """A test of a value that has its type and, for people, what passes it."""

    test: Callable[[Any], object]
    allowed: str


FILLED = Form(bool, "not empty")  # whatever else it is


def words(allowed: str) -> Form:
    """What is allowed, in other words than those of its type."""
    return Form(lambda _value: True, allowed)


def number(low: float, above: bool = False) -> Form:
    """A number from `low` on, or above it."""
    if above:
        return Form(lambda value: value > low, f"a number, more than {low}")
    return Form(lambda value: value >= low, f"a number, {low} or more")


def whole(low: int, high: int = 86400) -> Form:
    """A whole number; a day is the longest time that makes sense in seconds."""
    return Form(lambda value: low <= value <= high, f"a whole number, {low} or more and {high} or less")


def quantity_value(text: str) -> Decimal | None:
    """A Kubernetes quantity as a number; None if it is none.

    >>> quantity_value("500m"), quantity_value("1Ki"), quantity_value("2GB")
    (Decimal('0.500'), Decimal('1024'), None)
    """
    match = _QUANTITY.fullmatch(text)
    if match is None:
        return None
    number, suffix = Decimal(match["number"]), match["suffix"] or ""
    scale = _SCALE[suffix] if suffix in _SCALE else Decimal(10) ** int(suffix[1:])
    return number * scale


def moving_tag(image: str) -> bool:
    """Whether a reference may mean another image tomorrow: no digest, and no tag or `latest`."""
    match = _IMAGE.fullmatch(image)
    return match is not None and match["digest"] is None and match["tag"] in (None, "latest")


def clean_path(path: str) -> bool:
    """An absolute path that says what it means: no '..', no '.', no doubled slash, nothing that mounts split at."""
    parts = path.rstrip("/").split("/")[1:]
    whole = path.startswith("/") and bool(parts) and not {"", ".", ".."} & {*parts}
    return whole and ":" not in path and not _BLANK.search(path)


def safe_host_path(path: str) -> bool:
    """Whether a pod may have this path of its host."""
    bare = path.rstrip("/")
    private = bare in UNSAFE_DEVICES or {*PRIVATE_PARTS} & {*bare.split("/")}
    return bool(_SAFE.fullmatch(bare)) and not private and clean_path(path)


def device_path(path: str) -> bool:
    """A device file, or with a slash at its end a directory of them."""
    bare = path.rstrip("/")
    return clean_path(path) and bare.startswith("/dev/") and bare not in UNSAFE_DEVICES


def bare_url(text: str, schemes: tuple[str, ...], with_port: bool) -> bool:
    """`<scheme>://<host>` and nothing more, with a port or without one."""
    try:
        parts = urlsplit(text)
        host, port = parts.hostname, parts.port
    except ValueError:
        return False
    plain = not (parts.path.strip("/") or parts.query or parts.fragment or parts.username or _BLANK.search(text))
    return parts.scheme in schemes and (bool(port) if with_port else port is None) and plain and _host(host or "")


def _host(text: str) -> bool:
    if re.fullmatch(r"[0-9.]+", text) or ":" in text:
        return _parses(ipaddress.ip_address, text)
    return bool(re.fullmatch(_SUBDOMAIN, text))


def _parses(parse: Callable[[str], object], text: str) -> bool:
    try:
        parse(text)
    except (ValueError, ZoneInfoNotFoundError, OSError):  # the last of a zone's name that is no file's
        return False
    return True


def _text(pattern: str, allowed: str, longest: int = 253) -> Form:
    compiled = re.compile(pattern, re.ASCII)
    return Form(lambda text: len(text) <= longest and compiled.fullmatch(text) is not None, allowed)


def _label(longest: int) -> Form:
    allowed = f"at most {longest} lower-case letters, digits and dashes, with a letter or digit at both ends"
    return _text(_LABEL, allowed, longest)


_NAME = r"[A-Za-z]\w*"  # of ROS, without a slash
_PATH = rf"{_NAME}(?:/\w+)*"
_REST = r"\w+(?:/\w+)*"  # after a slash or ~, where a name may begin with a digit (rosgraph.names.is_legal_name)
FORMS: dict[str, Form] = {
    "app-name": _text(r"[a-z](?:[-a-z0-9]*[a-z0-9])?", "at most 40 lower-case letters, digits and dashes, beginning "
                      "with a letter, not ending with a dash", 40),
    "robot-name": _label(57),
    "volume-name": _label(59),
    "dns-name": _text(_SUBDOMAIN, "lower-case letters, digits, dashes and dots (a DNS name)"),
    "image": Form(lambda text: _IMAGE.fullmatch(text) is not None, "an image reference such as ros:noetic-ros-core"),
    "quantity": Form(lambda text: quantity_value(text) is not None, "a Kubernetes quantity such as 500m, 256Mi or 2"),
    "size": Form(lambda text: (quantity_value(text) or 0) > 0, "a Kubernetes quantity above zero such as 500Mi or 1Gi"),
    "unicode": Form(lambda text: _parses(str.encode, text), "text that UTF-8 can say, no half of a surrogate pair"),
    "env-name": _text(r"[A-Za-z_]\w*", "letters, digits and underscores, not beginning with a digit"),
    "resource-name": _text(rf"(?:{_SUBDOMAIN}/)?[A-Za-z0-9][-\w.]*",
                           "cpu, memory, ephemeral-storage or <vendor>/<resource>"),
    "graph-name": _text(rf"(?:~/?|/){_REST}|{_PATH}", "a ROS name such as temperature, /temperature or ~status"),
    "graph-pattern": _text(r"(?:(?:~/?|/)[\w*]|[A-Za-z*])[\w*]*(?:/[\w*]+)*",
                           "a ROS name such as /scan or ~status, * standing for anything: /debug/*"),
    "private-name": _text(rf"(?:~/?)?{_PATH}", "a private ROS name such as status or ~status"),
    "node-name": _text(_NAME, "a ROS node name: letters, digits and underscores, beginning with a letter, no slash"),
    "param-name": _text(rf"/{_REST}|{_PATH}",
                        "a ROS name such as rate, pid/gain or, for one that is read by all, /rate"),
    "package-name": _text(r"[A-Za-z][\w-]*", "a ROS package's name"),
    "launch-file": _text(r"/?[\w.][\w.+-]*(?:/[\w.+-]+)*", "a launch file's name, or with / first its whole path"),
    "node-path": _text(rf"/?{_PATH}", "the name of a <node> of the launch file, such as lidar or front/lidar"),
    "launch-arg": _text(r"[A-Za-z]\w*", "the name of an <arg> of the launch file, beginning with a letter"),
    "ros-type": _text(rf"{_NAME}/{_NAME}", "<package>/<type> such as std_msgs/Float64"),
    # the master speaks plain XML-RPC at the root
    "master-uri": Form(lambda text: bare_url(text, ("http",), with_port=True), "http://<host>:<port>"),
    "device": Form(device_path, "a path below /dev without ':' or blanks, but /dev/mem, /dev/kmem and /dev/port"),
    "host-path": Form(safe_host_path, HOST_PATHS),
    "port-name": _text(r"(?=.*[a-z])[a-z0-9]+(?:-[a-z0-9]+)*",
                       "at most 15 lower-case letters, digits and dashes, a letter among them", 15),
    "secret-key": _text(r"[-\w.]+", "letters, digits, -, _ and ."),
    "file-mode": _text(r"0[0-7]{3}", 'four octal digits in quotes, such as "0644"'),
    "mount-path": Form(clean_path, "an absolute path other than /, without '..', ':' or blanks"),
    "retention": _text(r"(?:[0-9]+(?:ms|[smhdwy]))+",
                       "a duration as Prometheus writes it, such as 10s, 24h, 7d or 1w2d"),
    # its ports are variables of their own
    "hub-url": Form(lambda text: bare_url(text, ("http", "https"), with_port=False),
                    "http://<host> or https://<host>, without a port and a path"),
    "network": Form(lambda text: "/" in text and _parses(ipaddress.ip_network, text), "a network such as 192.0.2.0/24"),
    "k3s-version": _text(r"v[0-9]+\.[0-9]+\.[0-9]+(?:-[\w.]+)?\+[\w.]+",
                         "a release of k3s such as v1.34.2+k3s1, with the v and what follows the +"),
    "addresses": Form(lambda text: all(_parses(ipaddress.ip_address, one) for one in text.split(",")),
                      "an IP address, or one of each family with a comma between them"),
    "time-of-day": _text(r"(?:[01][0-9]|2[0-3]):[0-5][0-9]|24:00",
                         'hours and minutes in quotes, such as "06:30" or "22:00"'),
    "time-zone": Form(lambda text: _parses(ZoneInfo, text), "a name of the time zone database such as Europe/Berlin "
                      "(a control node without one: pip install tzdata)"),
    "label-value": _text(r"(?:[A-Za-z0-9](?:[-\w.]*[A-Za-z0-9])?)?", "at most 63 letters, digits, -, _ and .", 63),
    "label-name": _text(rf"(?:{_SUBDOMAIN}/)?[A-Za-z0-9](?:[-\w.]{{0,61}}[A-Za-z0-9])?",
                        "a label such as example.org/site"),
}  # fmt: skip

WAVE = re.compile(r"[1-9][0-9]*|(0*[1-9][0-9]?|100)%")


def listed(value: Any) -> list[Any]:
    """The list that was meant: of YAML or JSON, or of words with commas, blanks or lines between them.

    Nothing and an empty text, which an optional question of a survey gives, are an empty list.
    """
    if isinstance(value, (list, tuple)):
        return list(value)
    if isinstance(value, (int, float)):
        return [value]
    text = "" if value is None else str(value).strip()
    if not text.startswith("["):
        return [word for word in re.split(r"[\s,]+", text) if word]
    with contextlib.suppress(yaml.YAMLError, RecursionError, ValueError):  # the last: a day or a number that is none
        if isinstance(found := yaml.safe_load(text), list):
            return found
    raise SpecError(f"{text!r} is no list; allowed: a list, or words with commas between them")


def wrong_waves(value: Any) -> str:
    """What is wrong with waves of hosts, which Ansible would only stumble over; empty if nothing is."""
    try:
        waves = listed(value)
    except SpecError as error:
        return str(error)
    wrong = [wave for wave in waves if isinstance(wave, bool) or not WAVE.fullmatch(str(wave))]
    return f"has {wrong[0]!r}" if wrong else ""
