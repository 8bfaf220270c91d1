// SPDX-License-Identifier: GPL-3.0-or-later
// A simulated temperature sensor: RATE_HZ (500) readings a second on the topic `temperature`.
#include <rosops_apps/Temperature.h>

#include <memory>

#include "node.hpp"
#include "pacing.hpp"
#include "sequence.hpp"

namespace {

constexpr double kLongestSleep = 0.5;
constexpr double kSensorRate = 500.0;  // samples a second

struct Settings {
    double rate;
    std::int64_t stride;
    std::uint32_t queue;
    std::string directory;
};

Settings read_settings() {
    const double rate = rosops::positive("RATE_HZ", kSensorRate);
    const std::int64_t stride = std::llround(kSensorRate / rate);
    if (stride < 1 || std::abs(rate * static_cast<double>(stride) - kSensorRate) > 1e-6 * kSensorRate) {
        throw rosops::SettingError("RATE_HZ must be 500, the sensor's samples a second, divided by a whole number");
    }
    return {rate, stride, rosops::queue_size(), rosops::setting("LOG_DIR")};
}

class Sensor {
public:
    explicit Sensor(const Settings& values) : stride_(values.stride) {
        topic_ = ros::NodeHandle().advertise<rosops_apps::Temperature>("temperature", values.queue);
        message_.header.frame_id = "temperature_sensor";
        if (!values.directory.empty()) {
            const std::filesystem::path directory = values.directory;
            log_ = std::make_unique<rosops::JsonLinesLog>(directory / "temperature-published.jsonl");
        }
    }

    void publish(std::int64_t reading) {
        const std::int64_t number = reading * stride_;
        message_.sequence = static_cast<std::uint64_t>(number);
        message_.celsius = rosops::celsius(number, kSensorRate);
        message_.header.stamp.fromSec(static_cast<double>(number) / kSensorRate);
        topic_.publish(message_);
        account_.add(number);
        ++sent;
    }

    void record() {
        if (!log_) return;
        rosops::JsonLine line;
        line.add("time", rosops::wall(), 3, true).add("node", ros::this_node::getName());
        line.add("sent", sent).add("skipped", skipped).add("ranges", account_.take_ranges());
        log_->write(line);
    }

    std::int64_t sent = 0;
    std::int64_t skipped = 0;

private:
    std::int64_t stride_;
    ros::Publisher topic_;
    rosops_apps::Temperature message_;
    rosops::SequenceTracker account_;
    std::unique_ptr<rosops::JsonLinesLog> log_;
};

void pace(Sensor& sensor, const Settings& values) {
    // After a stall as many readings as half a queue holds are caught up; more would push out what waits there.
    const std::int64_t most =
        std::max<std::int64_t>(1, std::min<std::int64_t>(values.queue / 2, static_cast<std::int64_t>(values.rate)));
    double now = rosops::monotonic();
    double followed = now;
    rosops::SampleClock clock(values.rate, rosops::wall(), now);
    std::int64_t last = clock.number(now);
    while (!rosops::stopping()) {
        const double pause = clock.due(last + 1) - rosops::monotonic();
        if (pause > 0) {
            ros::WallDuration(std::min(pause, kLongestSleep)).sleep();
            if (rosops::stopping()) break;
        }
        now = rosops::monotonic();
        const std::int64_t current = clock.number(now);
        if (current > last) {
            const std::int64_t first = std::max(last + 1, current - most + 1);
            const bool is_first = sensor.sent == 0;
            for (auto reading = first; reading <= current; ++reading) sensor.publish(reading);
            sensor.skipped += first - last - 1;
            last = current;
            if (is_first) rosops::ready();
        }
        if (now - followed >= 1.0) {
            clock.follow(rosops::wall(), now);
            sensor.record();
            followed = now;
        }
    }
}

void publish(const Settings& values) {
    Sensor sensor(values);
    pace(sensor, values);
    sensor.record();
    rosops::say(rosops::event("published").add("sent", sensor.sent).add("skipped", sensor.skipped));
    ros::WallDuration(0.05).sleep();  // roscpp's own thread sends meanwhile what is queued
}

}  // namespace

int main(int argc, char** argv) {
    return rosops::run(argc, argv, "temperature_publisher_cpp", read_settings, publish);
}
