// SPDX-License-Identifier: GPL-3.0-or-later
// Lines of JSON on a volume, as rosops_apps/jsonl.py writes and reads them: either language goes on from the other's.
#pragma once

#include <fcntl.h>
#include <unistd.h>

#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>

#include "pacing.hpp"
#include "sequence.hpp"

namespace rosops {

class JsonLine {
public:
    JsonLine& add(const char* key, const std::string& value) { return raw(key, '"' + value + '"'); }
    JsonLine& add(const char* key, std::int64_t value) { return raw(key, std::to_string(value)); }
    JsonLine& add(const char* key, double value, int digits = 17, bool fixed = false) {
        std::ostringstream text;
        if (fixed) text << std::fixed;
        text.precision(digits);
        text << value;
        return raw(key, text.str());
    }
    JsonLine& add(const char* key, const Ranges& ranges) {
        std::string text = "[";
        for (const auto& [first, last] : ranges) {
            text += (text.size() > 1 ? ",[" : "[") + std::to_string(first) + "," + std::to_string(last) + "]";
        }
        return raw(key, text + "]");
    }
    JsonLine& raw(const char* key, const std::string& value) {
        text_ += (text_.empty() ? "{\"" : ",\"") + std::string(key) + "\":" + value;
        return *this;
    }
    std::string text() const { return text_ + "}\n"; }

private:
    std::string text_;
};

// Appends a line in one write; the disk follows at most once a second.
class JsonLinesLog {
public:
    explicit JsonLinesLog(const std::filesystem::path& path) : synced_(monotonic()) {
        std::filesystem::create_directories(path.parent_path());
        file_ = open(path.c_str(), O_RDWR | O_APPEND | O_CREAT | O_CLOEXEC, 0644);
        if (file_ < 0) throw std::runtime_error("cannot write " + path.string());
        const auto end = lseek(file_, 0, SEEK_END);
        char last = '\n';
        if (end > 0 && pread(file_, &last, 1, end - 1) == 1 && last != '\n') write_all("\n");  // torn by a crash
    }
    ~JsonLinesLog() {
        fdatasync(file_);
        close(file_);
    }
    JsonLinesLog(const JsonLinesLog&) = delete;
    JsonLinesLog& operator=(const JsonLinesLog&) = delete;

    void write(const JsonLine& line) {
        write_all(line.text());
        if (monotonic() - synced_ >= 1.0) {
            fdatasync(file_);
            synced_ = monotonic();
        }
    }

private:
    void write_all(const std::string& text) {
        if (::write(file_, text.data(), text.size()) < 0) throw std::runtime_error("cannot write the log");
    }
    int file_;
    double synced_;
};

// The number that stands after "key": in a line that this program or its Python twin has written.
inline std::optional<double> number_in(const std::string& line, const std::string& key) {
    const auto at = line.find('"' + key + "\":");
    if (at == std::string::npos) return std::nullopt;
    const char* start = line.c_str() + at + key.size() + 3;
    char* end = nullptr;
    const double value = std::strtod(start, &end);
    return end == start ? std::nullopt : std::optional<double>(value);
}

// The whole line at the file's end with the highest `key`; empty if there is none.
inline std::string last_record(const std::filesystem::path& path, const std::string& key) {
    std::ifstream file(path, std::ios::binary | std::ios::ate);
    if (!file) return "";
    const auto size = static_cast<std::int64_t>(file.tellg());
    file.seekg(std::max<std::int64_t>(0, size - 65536));
    std::string best;
    for (std::string line; std::getline(file, line);) {
        if (line.size() < 2 || line.front() != '{' || line.back() != '}') continue;
        const auto number = number_in(line, key);
        if (number && (best.empty() || *number >= *number_in(best, key))) best = line;
    }
    return best;
}

}  // namespace rosops
