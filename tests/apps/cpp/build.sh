#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
#
# Usage: build.sh DESTINATION   (a directory; the programs are put into it)
# Tests what the programs share with the Python ones, and compiles them and a nodelet. Needs g++, libnodeletlib-dev,
# libroscpp-dev, libstd-msgs-dev, python3-gencpp and ros-std-msgs; the programs run with libroscpp4d alone, the nodelet with
# libnodeletlib-tools.
set -eu

here=$(CDPATH='' cd -- "$(dirname -- "$0")" && pwd)
destination=$1
package=rosops_apps
include=$(mktemp -d)
trap 'rm -rf "$include"' EXIT

/usr/bin/python3 /usr/lib/gencpp/gen_cpp.py "$here/../msgs/msg/Temperature.msg" -p "$package" -o "$include/$package" \
    -e /usr/share/gencpp "-I$package:$here/../msgs/msg" -Istd_msgs:/usr/share/std_msgs/msg
g++ -std=c++17 -O1 -Wall -Wextra "$here/selftest.cpp" -o "$include/selftest"
"$include/selftest" >&2
for app in temperature_publisher temperature_subscriber; do
    g++ -std=c++17 -O2 -s -Wall -Wextra "-I$include" -DBOOST_BIND_GLOBAL_PLACEHOLDERS \
        "$here/$app.cpp" -o "$destination/${app}_cpp" \
        -Wl,--as-needed -lroscpp -lroscpp_serialization -lrosconsole -lrostime -lcpp_common -lxmlrpcpp -lboost_thread
done
# Debian has the headers of the libraries below one more directory than they include each other by
g++ -std=c++17 -O2 -s -shared -fPIC -Wall -Wextra "-I$include" -I/usr/include/pluginlib -I/usr/include/class_loader \
    -I/usr/include/rcutils -I/usr/include/rcpputils -I/usr/include/ament_index_cpp -DBOOST_BIND_GLOBAL_PLACEHOLDERS \
    "$here/relay_nodelet.cpp" -o "$destination/librelay_nodelet.so" \
    -Wl,--as-needed -lnodeletlib -lclass_loader -lroscpp -lroscpp_serialization -lrosconsole -lrostime
