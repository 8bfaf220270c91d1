#!/usr/bin/env python3
"""Publishes the mean of every five speeds."""

import rospy
from std_msgs.msg import Float64

speeds = []


def heard(message):
    speeds.append(message.data)
    if len(speeds) == 5:
        mean.publish(sum(speeds) / 5)
        speeds.clear()


rospy.init_node("mean")
mean = rospy.Publisher("mean_speed", Float64, queue_size=10)
rospy.Subscriber("wheel_speed", Float64, heard)
rospy.spin()
