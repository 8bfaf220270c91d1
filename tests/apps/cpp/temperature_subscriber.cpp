// Copyright: (c) 2026, rosops.fleet contributors
// GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
// SPDX-License-Identifier: GPL-3.0-or-later
// Statistics of the topic `temperature`, one JSON line a second in LOG_DIR/temperature-stats.jsonl.
//
// roscpp drops the oldest message of a full subscription queue and tells nobody. So the topic is subscribed to twice, which
// is one connection: the second subscription has no queue, its callback runs where the message is put into the first one's.
// What has arrived there and never comes out of the queue was dropped by it, and by nothing else.
#include <ros/callback_queue.h>
#include <rosops_apps/Temperature.h>

#include <mutex>

#include "node.hpp"
#include "sequence.hpp"
#include "stats.hpp"

namespace {

constexpr std::size_t kWindow = 500;
using Message = rosops_apps::Temperature;

// Runs a callback at once, in the thread that reads the connection.
class NoQueue : public ros::CallbackQueueInterface {
public:
    void addCallback(const ros::CallbackInterfacePtr& callback, std::uint64_t) override { callback->call(); }
    void removeByID(std::uint64_t) override {}
};

// Counts what is put into the queue behind it. A message that pushes out another one is not announced again: so many come out.
class CountingQueue : public ros::CallbackQueueInterface {
public:
    void addCallback(const ros::CallbackInterfacePtr& callback, std::uint64_t owner) override {
        ++count;
        queue.addCallback(callback, owner);
    }
    void removeByID(std::uint64_t owner) override { queue.removeByID(owner); }

    std::atomic<std::int64_t> count{0};
    ros::CallbackQueue queue;
};

// What has arrived, whatever the queue did with it. For each message roscpp serves the queue first, so that what it has
// taken in by then is final; the two counts read at any other time could be one apart.
class Arrivals {
public:
    explicit Arrivals(const std::atomic<std::int64_t>& taken_in) : taken_in_(taken_in) {}

    void take(const ros::MessageEvent<const Message>& event) {
        const std::lock_guard<std::mutex> lock(mutex_);
        const auto& message = *event.getConstMessage();
        const auto header = event.getConnectionHeaderPtr();
        const std::shared_ptr<const void> connection(header.get(), [header](const void*) {});
        ++count_;
        dropped_ = count_ - taken_in_;
        tracker_.add(static_cast<std::int64_t>(message.sequence));
        gaps_.add(event.getPublisherName(), connection, message.header.seq);
    }

    void report(rosops::JsonLine& line) {
        const std::lock_guard<std::mutex> lock(mutex_);
        line.add("arrived", count_).add("queue_dropped", dropped_);
        line.add("stream_gaps", gaps_.dropped).add("arrived_ranges", tracker_.take_ranges());
    }

private:
    std::mutex mutex_;
    const std::atomic<std::int64_t>& taken_in_;
    std::int64_t count_ = 0;
    std::int64_t dropped_ = 0;
    rosops::SequenceTracker tracker_;
    rosops::StreamGaps gaps_;
};

// What came out of the queue. One thread: callback and report are both the main loop's.
class Account {
public:
    explicit Account(const std::string& previous)
        : resumed_(!previous.empty()),
          resumed_from_(resumed_ ? static_cast<std::int64_t>(*rosops::number_in(previous, "last_sequence")) : -1),
          sequence_(resumed_from_),
          stats_(kWindow) {
        const auto number = [&previous](const char* key) { return rosops::number_in(previous, key).value_or(0.0); };
        if (!resumed_ || number("count") < 1) return;
        stats_.count = static_cast<std::int64_t>(number("count"));
        stats_.minimum = number("minimum");
        stats_.maximum = number("maximum");
        stats_.average = number("average");
        stats_.resume_deviation(number("standard_deviation"));
    }

    void take(const Message::ConstPtr& message) {
        const double age = rosops::wall() - message->header.stamp.toSec();
        const double now = rosops::monotonic();
        if (!sequence_.add(static_cast<std::int64_t>(message->sequence))) return;
        stats_.add(message->celsius);
        ++received;
        if (arrived_ > 0) gap_ = std::max(gap_, now - arrived_);
        arrived_ = now;
        age_ = std::max(age_, age);
    }

    bool any() const { return sequence_.any(); }

    void report(rosops::JsonLine& line) {
        line.add("received", received).add("count", stats_.count);
        line.add("minimum", stats_.minimum).add("maximum", stats_.maximum).add("average", stats_.average);
        line.add("standard_deviation", stats_.standard_deviation()).add("moving_average", stats_.moving_average());
        line.raw("resumed_from", resumed_ ? std::to_string(resumed_from_) : "null");
        line.add("first_sequence", sequence_.first()).add("last_sequence", sequence_.last());
        line.add("missing", sequence_.missing()).add("duplicates", sequence_.duplicates);
        line.add("ranges", sequence_.take_ranges());
        line.add("longest_gap_ms", gap_ * 1e3, 3, true).add("oldest_age_ms", age_ * 1e3, 3, true);
        received = 0;
        gap_ = age_ = 0.0;
    }

    std::int64_t received = 0;

private:
    bool resumed_;
    std::int64_t resumed_from_;
    rosops::SequenceTracker sequence_;
    rosops::RunningStats stats_;
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
          log_(path_) {
        ros::SubscribeOptions queued;
        queued.init<Message>("temperature", values.queue, boost::bind(&Account::take, &account_, boost::placeholders::_1));
        queued.callback_queue = &counting_;
        queued.transport_hints = ros::TransportHints().tcpNoDelay();
        subscriptions_[0] = node_.subscribe(queued);

        ros::SubscribeOptions direct;
        direct.initByFullCallbackType<const ros::MessageEvent<const Message>&>(
            "temperature", 0, boost::bind(&Arrivals::take, &arrivals_, boost::placeholders::_1));
        direct.callback_queue = &none_;
        direct.transport_hints = queued.transport_hints;
        subscriptions_[1] = node_.subscribe(direct);
    }

    void spin() {
        double due = rosops::monotonic() + 1.0;
        while (!rosops::stopping()) {
            counting_.queue.callAvailable(ros::WallDuration(std::clamp(due - rosops::monotonic(), 0.0, 0.1)));
            if (rosops::monotonic() >= due) {
                due += 1.0;
                record(true);
            }
        }
        counting_.queue.callAvailable();  // what waits in the queue has arrived: it is counted, not lost
        record(false);
    }

private:
    void record(bool idle) {
        if (!account_.any() || !(idle || account_.received > 0)) return;
        rosops::JsonLine line;
        line.add("time", rosops::wall(), 3, true).add("node", ros::this_node::getName());
        line.add("version", rosops::version()).add("statistics", std::string("c++"));
        account_.report(line);
        arrivals_.report(line);
        log_.write(line);
    }

    std::filesystem::path path_;
    Account account_;
    NoQueue none_;
    CountingQueue counting_;
    Arrivals arrivals_{counting_.count};
    rosops::JsonLinesLog log_;
    ros::NodeHandle node_;
    ros::Subscriber subscriptions_[2];
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
