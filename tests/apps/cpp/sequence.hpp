// SPDX-License-Identifier: GPL-3.0-or-later
// Which samples came, and what a connection left out: rosops_apps/sequence.py in C++. No ROS.
#pragma once

#include <algorithm>
#include <cstdint>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace rosops {

using Ranges = std::vector<std::pair<std::int64_t, std::int64_t>>;

inline Ranges joined(Ranges ranges) {
    std::sort(ranges.begin(), ranges.end());
    Ranges result;
    for (const auto& range : ranges) {
        if (!result.empty() && range.first <= result.back().second + 1) {
            result.back().second = std::max(result.back().second, range.second);
        } else {
            result.push_back(range);
        }
    }
    return result;
}

// Accepts every number once; everything up to `after` has been accounted for by an earlier process.
class SequenceTracker {
public:
    explicit SequenceTracker(std::int64_t after = -1) : floor_(after) {}

    bool add(std::int64_t number) {
        if (first_ >= 0 && number == highest_ + 1) {
            highest_ = number;
        } else if (!out_of_order(number)) {
            ++duplicates;
            return false;
        }
        if (!ranges_.empty() && ranges_.back().second == number - 1) {
            ranges_.back().second = number;
        } else {
            ranges_.emplace_back(number, number);
        }
        return true;
    }

    Ranges take_ranges() { return joined(std::exchange(ranges_, {})); }
    bool any() const { return first_ >= 0; }
    std::int64_t first() const { return first_; }
    std::int64_t last() const { return highest_; }
    std::int64_t missing() const { return lost_for_good_ + static_cast<std::int64_t>(holes_.size()); }

    std::int64_t duplicates = 0;

private:
    static constexpr std::int64_t kRemember = 100000;

    bool out_of_order(std::int64_t number) {
        if (number <= floor_) return false;
        if (first_ < 0) {
            first_ = highest_ = number;
        } else if (number > highest_) {
            open_holes(highest_ + 1, number);
            highest_ = number;
        } else if (number < first_) {
            open_holes(number + 1, first_);
            first_ = number;
        } else {
            return holes_.erase(number) == 1;
        }
        return true;
    }

    void open_holes(std::int64_t start, std::int64_t stop) {
        const auto room = std::max<std::int64_t>(0, kRemember - static_cast<std::int64_t>(holes_.size()));
        const auto kept = std::max(start, stop - room);
        lost_for_good_ += kept - start;
        for (auto number = kept; number < stop; ++number) holes_.insert(number);
    }

    std::int64_t floor_;
    std::int64_t first_ = -1;
    std::int64_t highest_ = -1;
    std::set<std::int64_t> holes_;
    std::int64_t lost_for_good_ = 0;
    Ranges ranges_;
};

// Messages that a connection has left out, by the count that the publisher's library puts into each header: a full queue
// dropped them, TCP loses nothing. What is missing between two connections is not counted here.
class StreamGaps {
public:
    void add(const std::string& publisher, const std::shared_ptr<const void>& connection, std::uint32_t count) {
        auto& [known, last] = streams_[publisher];
        if (known == connection && count > last + 1) dropped += count - last - 1;
        known = connection;
        last = count;
    }

    std::int64_t dropped = 0;

private:
    std::map<std::string, std::pair<std::shared_ptr<const void>, std::uint32_t>> streams_;
};

}  // namespace rosops
