# shellcheck shell=sh
# Run in the ROS image while it is built: a master must start, answer, and know rosout. Without the entry point, of which the
# environment is what env leaves out, nobody finds ROS.
if env -i PATH=/usr/bin:/bin sh -c 'command -v roscore || python3 -c "import rospy" 2>/dev/null'; then
    echo "ROS is found without its entry point"
    exit 1
fi
roscore >/tmp/roscore.log 2>&1 &
for _try in $(seq 100); do
    if [ "$(rosnode list 2>/dev/null)" = /rosout ]; then
        python3 -c 'import actionlib, genpy, genmsg, rospy, sensor_msgs.msg, std_srvs.srv'
        echo "roscore answers"
        exit 0
    fi
    sleep 0.2
done
echo "roscore did not answer with /rosout in time; its output:"
cat /tmp/roscore.log
exit 1
