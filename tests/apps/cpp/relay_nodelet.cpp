// SPDX-License-Identifier: GPL-3.0-or-later
// A nodelet, as image pipelines have them: what comes on `temperature` goes out on its private topic `~out`.
#include <nodelet/nodelet.h>
#include <pluginlib/class_list_macros.hpp>
#include <ros/ros.h>
#include <rosops_apps/Temperature.h>

namespace rosops {

class Relay : public nodelet::Nodelet {
    void onInit() override {
        out_ = getPrivateNodeHandle().advertise<rosops_apps::Temperature>("out", 1000);
        in_ = getNodeHandle().subscribe("temperature", 1000, &Relay::pass, this);
    }
    void pass(const rosops_apps::Temperature::ConstPtr& message) { out_.publish(message); }

    ros::Publisher out_;
    ros::Subscriber in_;
};

}  // namespace rosops

PLUGINLIB_EXPORT_CLASS(rosops::Relay, nodelet::Nodelet)
