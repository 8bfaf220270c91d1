#!/usr/bin/env python3
"""Publishes the speed of a wheel that always turns alike."""

import rospy
from std_msgs.msg import Float64

rospy.init_node("driver")
speed = rospy.Publisher("wheel_speed", Float64, queue_size=10)
beat = rospy.Rate(rospy.get_param("~rate", 20))
while not rospy.is_shutdown():
    speed.publish(0.5)
    beat.sleep()
