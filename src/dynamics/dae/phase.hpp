/// \file
/// The phases of a run by the clock: sums for its summary, and a trace for people who ask where the time goes.
#pragma once

#include <array>
#include <cstddef>
#include <string>

#include "base/timeline.hpp"

namespace espalier::dynamics {

/// The rows of a trace.
enum class PhaseRow { steps, host, device };

/// The phases that a run went through. Later ones are left out when there are very many.
class PhaseTrace {
 public:
  PhaseTrace();
  void record(PhaseRow row, base::TimelineEvent event);
  /// How many phases were left out.
  [[nodiscard]] long left_out() const { return left_out_; }
  /// As base::Timeline::write().
  void write(const std::string& path) const { timeline_.write(path); }

 private:
  static constexpr long kMost = 2'000'000;  // 160 MB
  base::Timeline timeline_;
  std::array<int, 3> tracks_{};
  long recorded_ = 0, left_out_ = 0;
};

/// Lasts as long as the object: adds its seconds to a sum, and itself to a trace where there is one. Both outlive it.
class Phase {
 public:
  /// @param kind  a string literal @param trace  may be null
  Phase(const char* kind, double& sum, PhaseTrace* trace, PhaseRow row = PhaseRow::host)
      : kind_(kind), sum_(sum), trace_(trace), row_(row) {}
  ~Phase();
  Phase(const Phase&) = delete;
  Phase& operator=(const Phase&) = delete;
  /// Which of its kind it is, from 1.
  void set_number(long number) { number_ = number; }

 private:
  const char* kind_;
  double& sum_;
  PhaseTrace* trace_;
  PhaseRow row_;
  long number_ = 0;
  double begin_ = base::now_seconds();
};

}  // namespace espalier::dynamics
