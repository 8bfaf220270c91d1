// Copyright: (c) 2026, rosops.fleet contributors
// GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
// SPDX-License-Identifier: GPL-3.0-or-later
// Running statistics: rosops_apps/stats.py in C++. No ROS.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <deque>
#include <limits>
#include <numeric>

namespace rosops {

class RunningStats {
public:
    explicit RunningStats(std::size_t window) : window_size_(window) {}

    void add(double value) {
        ++count;
        const double delta = value - average;
        average += delta / static_cast<double>(count);
        squares_ += delta * (value - average);
        minimum = std::min(minimum, value);
        maximum = std::max(maximum, value);
        window_.push_back(value);
        if (window_.size() > window_size_) window_.pop_front();
    }

    double standard_deviation() const {
        return count > 1 ? std::sqrt(squares_ / static_cast<double>(count - 1)) : 0.0;
    }
    double moving_average() const {
        if (window_.empty()) return 0.0;
        return std::accumulate(window_.begin(), window_.end(), 0.0) / static_cast<double>(window_.size());
    }
    void resume_deviation(double deviation) {
        squares_ = deviation * deviation * static_cast<double>(std::max<std::int64_t>(0, count - 1));
    }

    std::int64_t count = 0;
    double minimum = std::numeric_limits<double>::infinity();
    double maximum = -std::numeric_limits<double>::infinity();
    double average = 0.0;

private:
    std::size_t window_size_;
    double squares_ = 0.0;
    std::deque<double> window_;
};

}  // namespace rosops
