/// \file
/// A record of who did what when, in a form that Perfetto and chrome://tracing open.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

#include "base/at.hpp"

namespace espalier::base {

/// Seconds since an arbitrary fixed point.
inline double now_seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

/// One finished task, or phase of a run.
struct TimelineEvent {
  const char* kind = "";    ///< what was done: a string literal
  std::int32_t front = -1;  ///< the front concerned; -1: none
  std::int32_t row = 0;     ///< tile row
  std::int32_t col = 0;     ///< tile column
  double begin = 0;         ///< now_seconds() when it was taken
  double end = 0;           ///< ... and when it was finished
  double flops = 0;         ///< arithmetic of the task
  double bytes = 0;         ///< bytes that it wrote
  double waited = 0;        ///< seconds between begin and end in which it waited for tasks of others
  std::int64_t number = 0;  ///< from 1, of phases that are counted; 0: not counted
};

/// Events by track (a worker of a device, or a queue). Each track is written by one thread at a time.
class Timeline {
 public:
  /// The number of the track of that device and name, which is added when there is none. Not thread-safe.
  int add_track(std::string device, std::string name);
  void record(int track, const TimelineEvent& event) { tracks_[at(track)].events.push_back(event); }
  /// Forgets the events, keeps the tracks.
  void clear();
  /// Writes the Chrome trace-event JSON format. @throws Error(invalid_input) when the file cannot be written
  void write(const std::string& path) const;

 private:
  struct Track {
    std::string device, name;
    std::vector<TimelineEvent> events;
  };
  std::vector<Track> tracks_;
};

}  // namespace espalier::base
