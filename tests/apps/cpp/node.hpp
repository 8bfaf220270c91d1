// SPDX-License-Identifier: GPL-3.0-or-later
// What both programs do the same way: settings, readiness file, clean stop (rosops_apps/node.py and settings.py in C++).
#pragma once

#include <ros/ros.h>
#include <ros/xmlrpc_manager.h>

#include <atomic>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <stdexcept>
#include <string>

#include "json_log.hpp"

namespace rosops {

struct SettingError : std::runtime_error {
    using std::runtime_error::runtime_error;
};

inline std::string setting(const char* name, const std::string& otherwise = "") {
    const char* text = std::getenv(name);
    return text && *text ? text : otherwise;
}

inline double positive(const char* name, double otherwise) {
    const std::string text = setting(name);
    if (text.empty()) return otherwise;
    char* end = nullptr;
    const double number = std::strtod(text.c_str(), &end);
    if (*end != '\0' || !(number > 0) || std::isinf(number)) {
        throw SettingError(std::string(name) + " must be a number above 0, not '" + text + "'");
    }
    return number;
}

inline std::uint32_t queue_size() {
    const double number = positive("QUEUE_SIZE", 1000);
    if (number != std::floor(number)) throw SettingError("QUEUE_SIZE must be a whole number");
    return static_cast<std::uint32_t>(number);
}

inline std::string version() {
    std::string text = setting("ROSOPS_APPS_VERSION");
    if (text.empty()) {
        std::error_code none;
        const auto self = std::filesystem::read_symlink("/proc/self/exe", none);
        std::ifstream(self.parent_path().parent_path() / "VERSION") >> text;
    }
    return text.empty() ? "unversioned" : text;
}

constexpr auto kReady = "/tmp/ready";

inline std::atomic<bool> stop_asked{false};
inline bool stopping() { return stop_asked || ros::isShuttingDown(); }

inline JsonLine event(const std::string& name) {
    return JsonLine().add("event", name).add("node", ros::this_node::getName());
}
inline void say(const JsonLine& line) { std::cout << line.text() << std::flush; }

inline void ready() {
    std::ofstream(kReady) << "ready\n";
    say(event("ready"));
}

// The slave API's `shutdown` closes all connections at once. Here it asks the program to stop, which does so when what it
// has counted as sent is out.
inline void stop_by_slave_api(XmlRpc::XmlRpcValue&, XmlRpc::XmlRpcValue& result) {
    stop_asked = true;
    result = ros::xmlrpc::responseInt(1, "", 0);
}

// Runs `application(settings)` as the ROS node `name` until it is asked to stop.
template <typename Read, typename Application>
int run(int argc, char** argv, const std::string& name, Read read_settings, Application application) {
    std::error_code none;
    try {
        const auto values = read_settings();
        std::filesystem::remove(kReady, none);
        ros::init(argc, argv, name, ros::init_options::NoSigintHandler);
        std::signal(SIGINT, [](int) { stop_asked = true; });
        // SIGTERM stays as roscpp has it, which is not at all: as process 1 of a container it does nothing.
        ros::start();
        ros::XMLRPCManager::instance()->unbind("shutdown");
        ros::XMLRPCManager::instance()->bind("shutdown", stop_by_slave_api);
        say(event("started").add("version", version()));
        application(values);
        ros::WallDuration(0.05).sleep();
        ros::shutdown();
        say(event("stopped"));
    } catch (const SettingError& error) {
        std::cerr << name << ": " << error.what() << std::endl;
        return 1;
    }
    std::filesystem::remove(kReady, none);
    return 0;
}

}  // namespace rosops
