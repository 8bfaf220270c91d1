#!/usr/bin/env bash
# As the official image's entry point: the environment of ROS, then the command. Debian installs ROS under /usr, so there
# is no setup.bash to source.
set -e
export ROS_DISTRO=${ROS_DISTRO:-noetic} ROS_ROOT=${ROS_ROOT:-/usr/share/ros} ROS_ETC_DIR=${ROS_ETC_DIR:-/etc/ros}
export ROS_PACKAGE_PATH=${ROS_PACKAGE_PATH:-/usr/share} ROS_PYTHON_VERSION=${ROS_PYTHON_VERSION:-3}
export ROS_MASTER_URI=${ROS_MASTER_URI:-http://localhost:11311}
exec "$@"
