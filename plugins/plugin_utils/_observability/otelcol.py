# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The OpenTelemetry collector as log shipper: every line through a queue on the host's disk. Pure.

A line is marked as read once it is in the queue, and leaves the queue once Loki has it; a full queue makes the receiver
wait, and then the containers' own files are what is kept. So neither a kill nor a cut link loses a line that is still
in a file or in the queue.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from ansible_collections.rosops.fleet.plugins.plugin_utils._observability import names as obs
from ansible_collections.rosops.fleet.plugins.plugin_utils._observability.pod_labels import (
    APP_OF_POD,
    PATH,
    POD_LOGS,
    ROBOT_OF_NAMESPACE,
    anchored,
)

Spec = Mapping[str, Any]

STATE_DIR = "/var/lib/rosops-fleet/log-shipper"
NODE_ENV = "NODE_NAME"
FEATURE_GATE = "stanza.synchronousLogEmitter"  # off, up to 100 ms of lines are marked as read before they are queued
MEMORY_LIMIT_MIB = 48
QUEUE_SIZE = 256 * 2**20  # a full queue loses nothing yet: lines then wait in the containers' own files
# Loki would keep with each line when it was read: no two lines would have the same labels then, and a line that is read
# again after a kill would not be known for the same.
NOT_WHEN_READ = "set(log.observed_time_unix_nano, 0)"
FILE = 'attributes["log.file.path"]'
# What containerd writes: time, stream, P for a part of a line or F for its end, text.
CRI_LINE = r"\A(?P<time>[^ ]+) (?P<stream>stdout|stderr) (?P<logtag>[^ ]*) ?(?P<log>.*)\z"


def otelcol_config(spec: Spec, loki_url: str) -> dict[str, Any]:
    """The collector's configuration; spec is complete, `loki_url` without a path."""
    return {
        "extensions": {"file_storage/checkpoints": _storage("checkpoints"), "file_storage/queue": _storage("queue")},
        "receivers": {"filelog": _filelog(spec)},
        "processors": {
            "memory_limiter": {"check_interval": "1s", "limit_mib": MEMORY_LIMIT_MIB, "spike_limit_mib": 12},
            "transform": {"log_statements": [{"context": "log", "statements": [NOT_WHEN_READ]}]},
        },
        "exporters": {"otlphttp": _loki(loki_url)},
        "service": {
            "extensions": ["file_storage/checkpoints", "file_storage/queue"],
            "pipelines": {
                "logs": {
                    "receivers": ["filelog"],
                    "processors": ["memory_limiter", "transform"],
                    "exporters": ["otlphttp"],
                }
            },
            "telemetry": {"logs": {"level": "warn"}, "metrics": _own_metrics()},
        },
    }


def _storage(name: str) -> dict[str, Any]:
    directory = f"{STATE_DIR}/{name}"
    return {
        "directory": directory,
        "create_directory": True,
        "recreate": True,  # a file that a power cut has spoilt must not keep the shipper from starting
        # after an outage the queue's file shrinks again
        "compaction": {"on_rebound": True, "directory": directory},
    }


def _filelog(spec: Spec) -> dict[str, Any]:
    own = f"{POD_LOGS}/{obs.NAMESPACE}_{obs.SHIPPER}-*/*/*"  # its own complaints would be new lines to complain about
    return {
        # the second: files that the kubelet has put aside, which may hold lines not read yet
        "include": [f"{POD_LOGS}/*/*/*.log", f"{POD_LOGS}/*/*/*.log.2*"],
        "exclude": [own, f"{POD_LOGS}/*/*/*.gz", f"{POD_LOGS}/*/*/*.tmp"],
        "start_at": "beginning",
        "poll_interval": "500ms",
        "max_concurrent_files": 64,
        "include_file_path": True,
        "include_file_name": False,
        "storage": "file_storage/checkpoints",
        "retry_on_failure": {"enabled": True, "initial_interval": "1s", "max_elapsed_time": "0s"},
        "operators": _operators(spec),
    }


def _operators(spec: Spec) -> list[dict[str, Any]]:
    """A container's line, then its labels as the resource's attributes. See _pod_labels.

    Not the operator `container`, which does the same: it hands lines on from a buffer of its own, and those are lost
    with the process although they are marked as read.
    """
    remote = json.dumps(sorted(set(spec["remote_nodes"])))
    placement = f'EXPR(env("{NODE_ENV}") in {remote} ? "remote" : "local")'
    given = [_add("resource.robot", spec["robot"])] if spec["robot"] else []
    time = {"parse_from": "attributes.time", "layout_type": "gotime", "layout": "2006-01-02T15:04:05.999999999Z07:00"}
    return [
        {"type": "regex_parser", "regex": CRI_LINE, "timestamp": time},
        {
            # the runtime cuts lines at 16 KiB
            "type": "recombine",
            "combine_field": "attributes.log",
            "combine_with": "",
            "is_last_entry": 'attributes.logtag == "F"',
            "source_identifier": FILE,
            "max_log_size": "1MiB",
        },
        _parse(FILE, anchored(PATH)),
        *given,
        {**_parse("resource.namespace", anchored(ROBOT_OF_NAMESPACE)), "if": 'resource.namespace startsWith "robot-"'},
        _parse("resource.pod", anchored(APP_OF_POD)),
        _add("resource.placement", placement),
        _move("attributes.log", "body"),
        *({"type": "remove", "field": field} for field in (FILE, "attributes.time", "attributes.logtag")),
    ]


def _move(source: str, target: str) -> dict[str, Any]:
    return {"type": "move", "from": source, "to": target}


def _add(field: str, value: str) -> dict[str, Any]:
    return {"type": "add", "field": field, "value": value}


def _parse(field: str, regex: str) -> dict[str, Any]:
    return {"type": "regex_parser", "parse_from": field, "parse_to": "resource", "regex": regex, "cache": {"size": 64}}


def _loki(loki_url: str) -> dict[str, Any]:
    return {
        "logs_endpoint": f"{loki_url}/otlp/v1/logs",
        "compression": "gzip",
        "timeout": "10s",
        "retry_on_failure": {
            "enabled": True,
            "initial_interval": "1s",
            "max_interval": "15s",
            "max_elapsed_time": "0s",
        },
        "sending_queue": {
            "enabled": True,
            "storage": "file_storage/queue",
            "sizer": "bytes",
            "queue_size": QUEUE_SIZE,
            "num_consumers": 1,  # in order
            "batch": {"flush_timeout": "1s", "min_size": 64 * 1024, "max_size": 512 * 1024},
        },
    }


def _own_metrics() -> dict[str, Any]:
    exporter = {
        "host": "0.0.0.0",  # noqa: S104 - the pod's address is known to the pod alone
        "port": obs.PORTS[obs.SHIPPER],
        # names as the collector has them by default
        "without_scope_info": True,
        "without_type_suffix": True,
        "without_units": True,
    }
    return {"level": "normal", "readers": [{"pull": {"exporter": {"prometheus": exporter}}}]}
