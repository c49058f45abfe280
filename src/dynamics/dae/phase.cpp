#include "dynamics/dae/phase.hpp"

#include <new>

namespace espalier::dynamics {

PhaseTrace::PhaseTrace()
    : tracks_{timeline_.add_track("simulation", "steps"), timeline_.add_track("simulation", "host"),
              timeline_.add_track("simulation", "device")} {}

void PhaseTrace::record(PhaseRow row, base::TimelineEvent event) {
  if (recorded_ == kMost) {
    ++left_out_;
    return;
  }
  timeline_.record(tracks_[static_cast<std::size_t>(row)], event);
  ++recorded_;
}

Phase::~Phase() {
  const double end = base::now_seconds();
  sum_ += end - begin_;
  if (trace_ == nullptr) return;
  base::TimelineEvent event{.kind = kind_, .begin = begin_, .end = end};
  event.number = number_;
  try {
    trace_->record(row_, event);
  } catch (const std::bad_alloc&) {  // a run does not end for want of a trace
  }
}

}  // namespace espalier::dynamics
