#include "base/timeline.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "base/output_file.hpp"

namespace espalier::base {

namespace {

// The inside of a JSON string.
std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '"' || c == '\\') out += '\\';
    if (static_cast<unsigned char>(c) < 0x20)
      out += fmt::format("\\u{:04x}", static_cast<unsigned>(c));
    else
      out += c;
  }
  return out;
}

std::string arguments(const TimelineEvent& e) {
  if (e.number > 0) return fmt::format("\"number\":{}", e.number);
  if (e.front < 0) return {};
  return fmt::format("\"front\":{},\"row\":{},\"col\":{},\"flops\":{:.0f},\"bytes\":{:.0f},\"waited\":{:.3f}", e.front,
                     e.row, e.col, e.flops, e.bytes, e.waited * 1e6);
}

}  // namespace

int Timeline::add_track(std::string device, std::string name) {
  for (std::size_t k = 0; k < tracks_.size(); ++k)
    if (tracks_[k].device == device && tracks_[k].name == name) return static_cast<int>(k);
  tracks_.push_back({std::move(device), std::move(name), {}});
  return static_cast<int>(tracks_.size()) - 1;
}

void Timeline::clear() {
  for (auto& t : tracks_) t.events.clear();
}

void Timeline::write(const std::string& path) const {
  OutputFile file(path);
  double start = 0;
  bool any = false;
  for (const auto& t : tracks_)
    for (const auto& e : t.events) {
      start = any ? std::min(start, e.begin) : e.begin;
      any = true;
    }
  std::string text = "{\"displayTimeUnit\":\"ms\",\"traceEvents\":[\n";
  std::vector<std::string> devices;
  const char* separator = "";
  for (std::size_t k = 0; k < tracks_.size(); ++k) {
    const Track& t = tracks_[k];
    auto device = std::find(devices.begin(), devices.end(), t.device);
    const auto pid = device - devices.begin();
    if (device == devices.end()) {
      devices.push_back(t.device);
      text += fmt::format("{}{{\"ph\":\"M\",\"pid\":{},\"name\":\"process_name\",\"args\":{{\"name\":\"{}\"}}}}",
                          separator, pid, escaped(t.device));
      separator = ",\n";
    }
    text +=
        fmt::format("{}{{\"ph\":\"M\",\"pid\":{},\"tid\":{},\"name\":\"thread_name\",\"args\":{{\"name\":\"{}\"}}}}",
                    separator, pid, k, escaped(t.name));
    separator = ",\n";
    for (const auto& e : t.events) {
      text += fmt::format(
          ",\n{{\"ph\":\"X\",\"pid\":{},\"tid\":{},\"ts\":{:.3f},\"dur\":{:.3f},\"name\":\"{}\",\"args\":{{{}}}}}", pid,
          k, (e.begin - start) * 1e6, (e.end - e.begin) * 1e6, e.kind, arguments(e));
      if (text.size() > (1U << 20)) {
        file.write(text);
        text.clear();
      }
    }
  }
  text += "\n]}\n";
  file.write(text);
  file.commit();
}

}  // namespace espalier::base
