#include "device/cuda/executor/side_outcome.hpp"

#include <algorithm>
#include <cstring>
#include <utility>

#include "device/determinant.hpp"

namespace espalier::device::cuda {

namespace {

template <class Is>
std::vector<Index> positions(const std::vector<unsigned char>& marks, Is&& is) {
  std::vector<Index> list;
  for (std::size_t k = 0; k < marks.size(); ++k)
    if (is(marks[k])) list.push_back(static_cast<Index>(k));
  return list;
}

struct Times {
  double busy, waiting;
};

Times times_of(const int* counters) {
  std::uint64_t taken = 0, waited = 0;
  std::memcpy(&taken, counters + kBusy, sizeof taken);
  std::memcpy(&waited, counters + kWaited, sizeof waited);
  const double waiting = 1e-9 * static_cast<double>(waited);
  return {1e-9 * static_cast<double>(taken) - waiting, waiting};
}

}  // namespace

void add_counters(const int* counters, Index n, std::size_t sides, FactorOutcome& out, SideFlags& flags) {
  flags.stopped = flags.stopped || counters[kAborted] != 0;
  flags.replaced = flags.replaced || counters[kReplaced] > 0;
  flags.failed = flags.failed || counters[kFailed] > 0;
  if (counters[kNotPositive] > 0) {
    const Index at = n - counters[kNotPositive];
    out.not_positive = out.not_positive < 0 ? at : std::min(out.not_positive, at);
  }
  out.negative += counters[kNegative];
  out.two_by_two += counters[kTwoByTwo];
  const Times times = times_of(counters);
  out.busy_seconds += times.busy / static_cast<double>(sides);
  out.waiting_seconds += times.waiting / static_cast<double>(sides);
}

DeviceWork work_of(const int* counters, std::string name, Offset held, Offset transferred_bytes) {
  const Times times = times_of(counters);
  DeviceWork work;
  work.name = std::move(name);
  work.busy_seconds = times.busy;
  work.waiting_seconds = times.waiting;
  work.stolen_subtrees = counters[kStolen];
  work.peak_bytes = held;
  work.transferred_bytes = transferred_bytes;
  return work;
}

void take_failed(const std::vector<unsigned char>& marks, FactorOutcome& out) {
  out.failed = positions(marks, [](unsigned char mark) { return mark != 0; });
}

void take_marks(const std::vector<unsigned char>& marks, FactorOutcome& out) {
  out.replaced = positions(marks, [](unsigned char mark) { return (mark & kPivotReplaced) != 0; });
  const auto small = [](unsigned char mark) { return (mark & (kPivotReplaced | kPivotSmall)) == kPivotSmall; };
  out.small = positions(marks, small);
  out.small_negative = static_cast<Index>(std::count_if(marks.begin(), marks.end(), [&](unsigned char mark) {
    return small(mark) && (mark & kPivotSmallNegative) != 0;
  }));
}

void take_determinant(const FactorEnd& end, FactorOutcome& out) {
  out.determinant_sign = end.sign;
  out.determinant_log = Determinant(end.mantissa, end.exponent).log();
}

template <class T>
void judge_pivots(const std::vector<T>& pivots, std::span<const double> smallest, FactorOutcome& out) {
  Determinant determinant;
  determinant.multiply(std::span<const T>(pivots));
  for (std::size_t k = 0; k < smallest.size(); ++k)
    if (static_cast<double>(pivots[k]) <= smallest[k]) out.replaced.push_back(static_cast<Index>(k));
  out.determinant_sign = determinant.sign();
  out.determinant_log = determinant.log();
}

template void judge_pivots(const std::vector<double>&, std::span<const double>, FactorOutcome&);
template void judge_pivots(const std::vector<float>&, std::span<const double>, FactorOutcome&);

}  // namespace espalier::device::cuda
