#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
#
# Usage: build.sh [DESTINATION]   (default /opt/rosops-apps; what was there is replaced)
# Needs python3-genpy, ros-std-msgs and ros-actionlib-msgs, in the lab's ROS image by its entry point. ROSOPS_APPS_VERSION
# (1.0) becomes the version the applications report, ROSOPS_APPS_BROKEN=true makes programs that cannot start. The C++
# programs are taken from compiled/, where cpp/build.sh or the lab has put them; without it they are left out.
set -eu

here=$(CDPATH='' cd -- "$(dirname -- "$0")" && pwd)
destination=${1:-/opt/rosops-apps}
package=rosops_apps
python=/usr/bin/python3 # Debian's: the one that its ROS packages are for
apps="temperature_publisher temperature_subscriber add_two_ints_server add_two_ints_client
    prime_factors_server prime_factors_client"

rm -rf "$destination"
mkdir -p "$destination/bin" "$destination/lib"
cp -R "$here/$package" "$destination/lib/"
find "$destination/lib" -name __pycache__ -prune -exec rm -rf {} +

generate() { # generate msg|srv FILE...
    kind=$1
    shift
    "$python" "/usr/lib/genpy/gen${kind}_py.py" -p "$package" -o "$destination/lib/$package/$kind" \
        "-I$package:$here/msgs/msg" -Istd_msgs:/usr/share/std_msgs/msg -Iactionlib_msgs:/usr/share/actionlib_msgs/msg "$@"
    "$python" "/usr/lib/genpy/gen${kind}_py.py" --initpy -o "$destination/lib/$package/$kind"
}
generate msg "$here"/msgs/msg/*.msg
generate srv "$here"/msgs/srv/*.srv

for app in $apps; do
    cat >"$destination/bin/$app" <<EOF
#!$python
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "lib"))
from $package.$app import main

main()
EOF
    chmod 0755 "$destination/bin/$app"
done
if [ -d "$here/compiled" ]; then
    install -m 0755 "$here"/compiled/* "$destination/bin/"
fi
if [ "${ROSOPS_APPS_BROKEN:-}" = true ]; then
    for program in "$destination"/bin/*; do
        echo '#!/opt/ros/melodic/bin/python' >"$program" # as if it were made for another distribution
    done
fi
cp "$here/readiness_probe.sh" "$destination/bin/"
chmod 0755 "$destination/bin/readiness_probe.sh"
printf '%s\n' "${ROSOPS_APPS_VERSION:-1.0}" >"$destination/VERSION"
# Compiled once here rather than at every start; by content, so that two builds of one source are equal.
"$python" -m compileall -q --invalidation-mode unchecked-hash "$destination/lib"
