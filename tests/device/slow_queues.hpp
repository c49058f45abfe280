/// \file
/// Copies between devices that are vectors, which take their time.
#pragma once

#include <cstring>
#include <deque>
#include <mutex>
#include <optional>
#include <random>
#include <vector>

#include "device/cuda/tables/copy_queues.hpp"
#include "espalier/types.hpp"

namespace espalier::emulated {

using device::cuda::CopyQueues;
using device::cuda::Way;

/// Copies are made some looks after they were begun, and in their order. A rectangle without a host fails.
class SlowQueues final : public CopyQueues {
 public:
  /// @param devices  guards the memory of all of them
  SlowQueues(unsigned seed, std::mutex& devices) : draw_(seed), devices_(devices) {}
  void copy(Way way, const Rectangle& what) override {
    if (what.host == nullptr) throw Error(StatusCode::device_error, "no copy");
    const bool out = way == Way::to_host;
    queue(way).push_back(
        {Copy{out ? what.device : what.host, out ? what.host : what.device, out ? what.pitch : what.row_bytes,
              out ? what.row_bytes : what.pitch, what.row_bytes, what.rows},
         0});
  }
  void pass_on(const PassedOn& what) override {
    queue(Way::to_device).push_back({Copy{what.from, what.to, what.pitch, what.pitch, what.row_bytes, what.rows}, 0});
  }
  std::uint64_t mark(Way way) override {
    queue(way).push_back({std::nullopt, next_});
    return next_++;
  }
  bool is_done(std::uint64_t mark) override {
    for (auto& q : queues_)
      for (auto most = draw_() % 4; most > 0 && !q.empty(); --most) make_first(q);
    return std::erase(passed_, mark) > 0;
  }
  void finish() noexcept override {
    for (auto& q : queues_)
      while (!q.empty()) make_first(q);
    passed_.clear();
  }

 private:
  struct Copy {
    const std::byte* from;
    std::byte* to;
    std::size_t from_pitch, to_pitch, row_bytes, rows;
  };
  struct Entry {
    std::optional<Copy> copy;  // none: a mark
    std::uint64_t mark;
  };
  std::deque<Entry>& queue(Way way) { return queues_[way == Way::to_host ? 0 : 1]; }
  void make_first(std::deque<Entry>& q) {
    const Entry e = q.front();
    q.pop_front();
    if (!e.copy) {
      passed_.push_back(e.mark);
      return;
    }
    const Copy& c = *e.copy;
    const std::lock_guard lock(devices_);
    for (std::size_t r = 0; r < c.rows; ++r) std::memcpy(c.to + r * c.to_pitch, c.from + r * c.from_pitch, c.row_bytes);
  }

  std::mt19937 draw_;
  std::mutex& devices_;
  std::deque<Entry> queues_[2];
  std::vector<std::uint64_t> passed_;
  std::uint64_t next_ = 0;
};

}  // namespace espalier::emulated
