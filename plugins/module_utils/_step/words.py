# SPDX-License-Identifier: GPL-3.0-or-later
"""Words that the control node, the keeper and the pods agree on: labels, annotations, names, keys of what is kept."""

from __future__ import annotations

MANAGER = "rosops.fleet"  # as whom runs and the keeper apply: fields that are not sent any more go
FLEET = "fleet"  # the namespace of what is the whole fleet's
# labels
ROBOT = "rosops.fleet/robot"
APP = "rosops.fleet/app"
REVISION = "rosops.fleet/revision"
TEMPLATE_HASH = "pod-template-hash"  # Kubernetes' own, other for each template that a Deployment ever had
KEPT = "rosops.fleet/kept"  # on a ConfigMap of the namespace `fleet`: the shared keeper looks after the one of its name
# annotations of a Deployment's pod template
NODE = "rosops.fleet/ros-node"
HANDOFF = "rosops.fleet/handoff"
LIVENESS = "rosops.fleet/liveness-timeout"  # where it is another one than the usual
LIVENESS_TIMEOUT, LIVENESS_LEAST = 120, 30  # s, the usual, and the shortest that an inventory may say
SETTINGS = "rosops.fleet/settings"  # what is to be seen of it on the graph, where nothing of ours is in the pod
# a pod's readiness gate, and its container of which that tells
READINESS = "rosops.fleet/ready"
CONTAINER = "ros-app"
HOPELESS = "cannot become ready: "  # begins a reason that waiting does not mend
# annotations of a Deployment
HASH = "rosops.fleet/spec-hash"  # of what was applied; of a pod template, too
UPDATING = "rosops.fleet/updating"  # the mark of a step: see `record.Mark`
BACK_TO = "rosops.fleet/back-to"  # beside a mark: what the version before is made of, see `_objects/admission.py`
SOAKING = "rosops.fleet/soaking"  # it soaks, see `record.soaks`; the text is a `record.Mark`
WENT_BACK = "rosops.fleet/went-back"  # the keeper took it back: JSON of from, to, at, reason, and the step's run
# Deployments and their Services
MASTER = "ros-master"
KEEPER = "ros-keeper"
KEEPER_PORT = 11411
PATH = "/v1/"  # of its door
JOBS_PATH = f"{PATH}jobs/"
LASTING = ("timeout", "rate_seconds")  # arguments that say how long a job there takes
# a run's, or the keeper's, while it changes the robot
LEASE = "robot-update"
LEASE_SECONDS = 15  # so long a robot waits after a run that was killed
OWNER = "rosops-may/"  # before the name of whoever else changes the robot: who has its Lease for as long as that says
# the ConfigMap `<app>-update`, see `record.Record`
CONTRACT = "contract.json"
HISTORY = "history.json"
# the ConfigMap of a robot that says when it may be changed, see `_robot/door.py`
REST, REST_KEY = "robot-rest", "rest.json"
