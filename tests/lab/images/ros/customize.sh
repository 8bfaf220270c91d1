#!/bin/sh
# Puts the entry point into the ROS tree (first argument) and takes out what no pod needs. Debian has its ROS in /usr; as in
# the official image, programs and Python packages are below /opt/ros/noetic, where nobody finds them without the entry point.
set -eu
root=$1
here=$(cd "$(dirname "$0")" && pwd)
ros=$root/opt/ros/noetic
install -D -m 0644 "$here/setup.bash" "$ros/setup.bash"
install -m 0755 "$here/ros_entrypoint.sh" "$root/ros_entrypoint.sh"
mkdir -p "$ros/bin" "$ros/etc" "$ros/lib/python3/dist-packages" "$ros/share"
mv "$root"/usr/bin/ros* "$ros/bin"
# but for rospkg, which is Debian's there, too
find "$root/usr/lib/python3/dist-packages" -maxdepth 1 ! -name 'rospkg*' \
    \( -name 'actionlib*' -o -name 'catkin' -o -name 'gen[mp]*' -o -name '*_msgs*' -o -name '*_srvs*' -o -name 'ros*' \) \
    -exec mv -t "$ros/lib/python3/dist-packages" {} +
ln -s /etc/ros "$ros/etc/ros"
for package in "$root"/usr/share/*/package.xml; do
    ln -s "/usr/share/$(basename "$(dirname "$package")")" "$ros/share"
done
rm -rf "$root"/var/log/*.log "$root"/var/log/apt "$root"/var/cache/debconf/*-old "$root"/var/cache/ldconfig/aux-cache
: > "$root/etc/machine-id"
