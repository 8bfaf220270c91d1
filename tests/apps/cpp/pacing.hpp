// SPDX-License-Identifier: GPL-3.0-or-later
// When the next reading is due, and what the sensor reads then: rosops_apps/pacing.py in C++. No ROS.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <ctime>

namespace rosops {

inline double seconds(clockid_t clock) {
    timespec now{};
    clock_gettime(clock, &now);
    return static_cast<double>(now.tv_sec) + static_cast<double>(now.tv_nsec) * 1e-9;
}
inline double monotonic() { return seconds(CLOCK_MONOTONIC); }
inline double wall() { return seconds(CLOCK_REALTIME); }

// Numbers readings by the wall clock (number = time x rate) but runs on the monotonic clock.
class SampleClock {
public:
    SampleClock(double rate, double wall, double monotonic)
        : rate_(rate), offset_(wall - monotonic), followed_(monotonic) {}

    // Moves towards the wall clock by at most 1 % of the time that passes; returns how far away it was.
    double follow(double wall, double monotonic) {
        const double away = (wall - monotonic) - offset_;
        const double most = 0.01 * std::max(0.0, monotonic - followed_);
        offset_ += std::clamp(away, -most, most);
        followed_ = monotonic;
        return away;
    }
    std::int64_t number(double monotonic) const {
        return static_cast<std::int64_t>(std::floor((monotonic + offset_) * rate_));
    }
    double due(std::int64_t number) const { return static_cast<double>(number) / rate_ - offset_; }

private:
    double rate_;
    double offset_;
    double followed_;
};

inline double celsius(std::int64_t number, double rate) {
    const double time = static_cast<double>(number) / rate;
    const auto bits = static_cast<std::uint64_t>(number) * 2654435761ULL & 0xFFFFULL;
    const double ripple = static_cast<double>(bits) / 65535.0 - 0.5;
    return 21.0 + 4.0 * std::sin(time * 2.0 * M_PI / 60.0) + 0.2 * ripple;
}

}  // namespace rosops
