# As the official image's: what lies below this directory is made known. Each ROS image has one, made by catkin.
# shellcheck shell=bash
ros=/opt/ros/noetic
export PATH=$ros/bin:$PATH
export PYTHONPATH=$ros/lib/python3/dist-packages${PYTHONPATH:+:$PYTHONPATH}
export LD_LIBRARY_PATH=$ros/lib${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}
export ROS_PACKAGE_PATH=$ros/share${ROS_PACKAGE_PATH:+:$ROS_PACKAGE_PATH}
export ROS_DISTRO=noetic ROS_VERSION=1 ROS_PYTHON_VERSION=3 ROS_ROOT=$ros/share/ros ROS_ETC_DIR=$ros/etc/ros
export ROS_MASTER_URI=${ROS_MASTER_URI:-http://localhost:11311}
unset ros
