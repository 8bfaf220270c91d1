// SPDX-License-Identifier: GPL-3.0-or-later
// Run while the programs are built: what they share with the Python ones behaves as there (tests/unit/apps).
#include <cstdio>

#include "json_log.hpp"
#include "pacing.hpp"
#include "sequence.hpp"

using rosops::Ranges;
using rosops::SequenceTracker;

#undef NDEBUG
#include <cassert>

static void sequences() {
    struct Case {
        std::vector<std::int64_t> numbers;
        std::int64_t missing, duplicates;
        Ranges ranges;
    };
    const std::vector<Case> cases = {
        {{5, 6, 7}, 0, 0, {{5, 7}}},
        {{5, 5, 6, 6}, 0, 2, {{5, 6}}},
        {{5, 8}, 2, 0, {{5, 5}, {8, 8}}},
        {{5, 8, 6}, 1, 0, {{5, 6}, {8, 8}}},
        {{5, 8, 6, 7, 7}, 0, 1, {{5, 8}}},
        {{7, 5, 8}, 1, 0, {{5, 5}, {7, 8}}},
        {{0, 1}, 0, 0, {{0, 1}}},
    };
    for (const auto& test : cases) {
        SequenceTracker tracker;
        for (const auto number : test.numbers) tracker.add(number);
        assert(tracker.missing() == test.missing);
        assert(tracker.duplicates == test.duplicates);
        assert(tracker.take_ranges() == test.ranges);
    }
    SequenceTracker resumed(10);
    assert(!resumed.add(10) && resumed.add(12) && resumed.missing() == 0);
    SequenceTracker far;
    far.add(0);
    far.add(1000000);
    assert(far.missing() == 999999);
}

static void streams() {
    rosops::StreamGaps gaps;
    const auto first = std::make_shared<int>(1);
    const auto second = std::make_shared<int>(2);
    for (const std::uint32_t count : {7U, 8U, 11U}) gaps.add("/a", first, count);
    assert(gaps.dropped == 2);
    gaps.add("/b", first, 50);  // another publisher counts for itself
    gaps.add("/a", second, 99);  // a new connection starts anew
    assert(gaps.dropped == 2);
}

static void readings() {
    assert(std::abs(rosops::celsius(897623395491, 500.0) - 17.815523443496538) < 1e-9);
    rosops::SampleClock clock(500.0, 1000.0, 10.0);
    assert(clock.number(10.0) == 500000 && clock.due(500001) > 10.0019 && clock.due(500001) < 10.0021);
    assert(clock.follow(1011.0, 20.0) > 0.99 && clock.number(20.0) == 505050);  // a second away: 1 % of ten seconds
}

static void logs() {
    const std::filesystem::path path = std::filesystem::temp_directory_path() / "selftest.jsonl";
    std::filesystem::remove(path);
    assert(rosops::last_record(path, "n").empty());
    {
        rosops::JsonLinesLog log(path);
        log.write(rosops::JsonLine().add("n", std::int64_t{5}).add("x", 0.5).add("r", Ranges{{1, 2}, {4, 4}}));
        log.write(rosops::JsonLine().add("n", std::int64_t{4}));
    }
    std::ofstream(path, std::ios::app) << "{\"n\":9";  // torn by a crash
    assert(rosops::last_record(path, "n") == "{\"n\":5,\"x\":0.5,\"r\":[[1,2],[4,4]]}");
    { rosops::JsonLinesLog(path).write(rosops::JsonLine().add("n", std::int64_t{6})); }
    assert(rosops::last_record(path, "n") == "{\"n\":6}");
    assert(!rosops::number_in("{\"n\":6}", "m"));
    std::filesystem::remove(path);
}

int main() {
    sequences();
    streams();
    readings();
    logs();
    std::puts("the C++ apps' self-test passed");
}
