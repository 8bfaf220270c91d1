// SPDX-License-Identifier: GPL-3.0-or-later
// What came on the topic `temperature`, one JSON line a second in LOG_DIR/temperature-stats.jsonl.
#include <ros/callback_queue.h>
#include <rosops_apps/Temperature.h>

#include "node.hpp"
#include "sequence.hpp"

namespace {

using Message = rosops_apps::Temperature;

// One thread: callback and report are both the main loop's.
class Account {
public:
    explicit Account(const std::string& previous)
        : resumed_from_(rosops::number_in(previous, "last_sequence")),
          sequence_(static_cast<std::int64_t>(resumed_from_.value_or(-1))) {}

    void take(const ros::MessageEvent<const Message>& event) {
        const auto& message = *event.getConstMessage();
        const auto header = event.getConnectionHeaderPtr();
        const std::shared_ptr<const void> connection(header.get(), [header](const void*) {});
        gaps_.add(event.getPublisherName(), connection, message.header.seq);
        const double age = rosops::wall() - message.header.stamp.toSec();
        const double now = rosops::monotonic();
        if (!sequence_.add(static_cast<std::int64_t>(message.sequence))) return;
        ++received;
        if (arrived_ > 0) gap_ = std::max(gap_, now - arrived_);
        arrived_ = now;
        age_ = std::max(age_, age);
    }

    bool any() const { return sequence_.any(); }

    void report(rosops::JsonLine& line) {
        line.add("received", received);
        line.raw("resumed_from", resumed_from_ ? std::to_string(static_cast<std::int64_t>(*resumed_from_)) : "null");
        line.add("first_sequence", sequence_.first()).add("last_sequence", sequence_.last());
        line.add("missing", sequence_.missing()).add("duplicates", sequence_.duplicates);
        line.add("stream_gaps", gaps_.dropped).add("ranges", sequence_.take_ranges());
        line.add("longest_gap_ms", gap_ * 1e3, 3, true).add("oldest_age_ms", age_ * 1e3, 3, true);
        received = 0;
        gap_ = age_ = 0.0;
    }

    std::int64_t received = 0;

private:
    std::optional<double> resumed_from_;
    rosops::SequenceTracker sequence_;
    rosops::StreamGaps gaps_;
    double arrived_ = 0.0;
    double gap_ = 0.0;
    double age_ = 0.0;
};

struct Settings {
    std::filesystem::path directory;
    std::uint32_t queue;
};

Settings read_settings() {
    const std::string directory = rosops::setting("LOG_DIR");
    if (directory.empty()) throw rosops::SettingError("LOG_DIR must name the directory of the log");
    return {directory, rosops::queue_size()};
}

class Subscriber {
public:
    explicit Subscriber(const Settings& values)
        : path_(values.directory / "temperature-stats.jsonl"),
          account_(rosops::last_record(path_, "last_sequence")),
          log_(path_),
          subscriber_(node_.subscribe(
              "temperature", values.queue, &Account::take, &account_, ros::TransportHints().tcpNoDelay())) {}

    void spin() {
        auto& queue = *ros::getGlobalCallbackQueue();
        double due = rosops::monotonic() + 1.0;
        while (!rosops::stopping()) {
            queue.callAvailable(ros::WallDuration(std::clamp(due - rosops::monotonic(), 0.0, 0.1)));
            if (rosops::monotonic() >= due) {
                due += 1.0;
                record(true);
            }
        }
        queue.callAvailable();  // what waits in the queue has arrived: it is counted, not lost
        record(false);
    }

private:
    void record(bool idle) {
        if (!account_.any() || !(idle || account_.received > 0)) return;
        rosops::JsonLine line;
        line.add("time", rosops::wall(), 3, true).add("node", ros::this_node::getName());
        line.add("version", rosops::version());
        account_.report(line);
        log_.write(line);
    }

    std::filesystem::path path_;
    Account account_;
    rosops::JsonLinesLog log_;
    ros::NodeHandle node_;
    ros::Subscriber subscriber_;
};

void subscribe(const Settings& values) {
    Subscriber subscriber(values);
    rosops::ready();
    subscriber.spin();
}

}  // namespace

int main(int argc, char** argv) {
    return rosops::run(argc, argv, "temperature_subscriber_cpp", read_settings, subscribe);
}
