#!/usr/bin/env bash
# As the official image's entry point: the environment of ROS, then the command.
set -e
# shellcheck source=/dev/null
source "/opt/ros/$ROS_DISTRO/setup.bash"
exec "$@"
