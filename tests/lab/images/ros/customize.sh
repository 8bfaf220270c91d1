#!/bin/sh
# Puts the entry point into the ROS tree (first argument) and takes out what no pod needs.
set -eu
root=$1
here=$(cd "$(dirname "$0")" && pwd)
install -m 0755 "$here/ros_entrypoint.sh" "$root/ros_entrypoint.sh"
rm -rf "$root"/var/log/*.log "$root"/var/log/apt "$root"/var/cache/debconf/*-old "$root"/var/cache/ldconfig/aux-cache
: > "$root/etc/machine-id"
