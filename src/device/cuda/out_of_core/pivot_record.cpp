#include "device/cuda/out_of_core/pivot_record.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "device/cuda/kernels/factor/pivot_limits.hpp"
#include "device/cuda/tables/pivot_pair.hpp"

namespace espalier::device::cuda {

namespace {

template <class U>
U read(std::span<const std::byte> bytes, Offset at) {
  U value;
  std::memcpy(&value, bytes.data() + at, sizeof value);
  return value;
}

}  // namespace

template <class T>
PivotRecord<T>::PivotRecord(Kind kind, Index n) : kind_(kind) {
  if (kind != Kind::ldlt) return;
  inverse_d_.resize(static_cast<std::size_t>(n));
  inverse_e_.resize(static_cast<std::size_t>(n));
}

template <class T>
void PivotRecord<T>::begin() {
  outcome_ = FactorOutcome{};
  determinant_ = Determinant{};
  stopped_ = false;
}

template <class T>
void PivotRecord<T>::take(std::size_t unit, const ScratchPlaces& at, const Positions& positions, const PivotRule& rule,
                          std::span<const std::byte> bytes) {
  if (bytes.empty()) return read_unit(at, positions, rule, units_[unit].bytes);
  const std::size_t before = doubtful();
  read_unit(at, positions, rule, bytes);
  if (units_.empty()) return;
  KeptOutputs& kept = units_[unit];
  kept.bytes.assign(bytes.begin(), bytes.end());
  kept.limits = limits_of<T>(rule);
  // None is smaller than the suspect ones.
  kept.firm = doubtful() == before && read<int>(bytes, at.control + 4 * kNear) == 0 &&
              kept.limits[2] >= kFarFromTiny * kept.limits[0];
}

template <class T>
bool PivotRecord<T>::stays(std::size_t unit, const PivotRule& rule) const {
  const KeptOutputs& kept = units_[unit];
  return kept.bytes.empty() || judged_alike<T>(kind_, kept.limits, limits_of<T>(rule), true, kept.firm);
}

template <class T>
void PivotRecord<T>::mark_others(const out_of_core::OutOfCorePlan& plan, const PivotRule& rule,
                                 std::vector<char>& fronts) const {
  const auto mark = [&](std::size_t unit, Index front) {
    if (!stays(unit, rule)) fronts[static_cast<std::size_t>(front)] = 1;
  };
  for (std::size_t s = 0; s < plan.steps.size(); ++s)
    if (!plan.steps[s].fronts.empty()) mark(s, plan.steps[s].fronts.front());
  for (std::size_t g = 0; g < plan.groups.size(); ++g) mark(plan.steps.size() + g, plan.groups[g].front);
}

template <class T>
void PivotRecord<T>::read_unit(const ScratchPlaces& at, const Positions& positions, const PivotRule& rule,
                               std::span<const std::byte> bytes) {
  constexpr auto kSize = static_cast<Offset>(sizeof(T));
  const auto control = [&](int counter) { return read<int>(bytes, at.control + 4 * counter); };
  const auto marked = [&](Offset list, Index k) { return bytes[static_cast<std::size_t>(list + k)] != std::byte{0}; };
  stopped_ = stopped_ || control(kAborted) != 0;
  const bool good = control(kNotPositive) == 0;
  Index k = 0;
  for (const auto& [begin, end] : positions)
    for (Index position = begin; position < end; ++position, ++k) {
      const auto pivot = static_cast<double>(read<T>(bytes, at.pivot + k * kSize));
      if (good) determinant_.multiply(pivot);
      if (good && !rule.smallest.empty() && pivot <= rule.smallest[static_cast<std::size_t>(position)])
        outcome_.replaced.push_back(position);
      if (marked(at.replaced, k)) outcome_.replaced.push_back(position);
      if (marked(at.failed, k)) outcome_.failed.push_back(position);
      if (!good && k == at.pivots - control(kNotPositive))
        outcome_.not_positive = outcome_.not_positive < 0 ? position : std::min(outcome_.not_positive, position);
      if (kind_ == Kind::lu && !marked(at.replaced, k)) judge(position, pivot, rule.suspect);
      if (kind_ != Kind::ldlt) continue;
      inverse_d_[static_cast<std::size_t>(position)] = read<T>(bytes, at.inverse_d + k * kSize);
      inverse_e_[static_cast<std::size_t>(position)] = read<T>(bytes, at.inverse_e + k * kSize);
    }
  if (kind_ == Kind::ldlt)
    judge_blocks(positions, rule.suspect, [&](Index pivot) { return marked(at.replaced, pivot); });
  outcome_.negative += control(kNegative);
  outcome_.two_by_two += control(kTwoByTwo);
}

template <class T>
void PivotRecord<T>::judge(Index position, double pivot, double suspect) {
  if (!(std::abs(pivot) < suspect)) return;
  outcome_.small.push_back(position);
  if (kind_ == Kind::ldlt && pivot < 0) ++outcome_.small_negative;
}

// A pair of pivots lies in one tile, so in one range.
template <class T>
template <class IsReplaced>
void PivotRecord<T>::judge_blocks(const Positions& positions, double suspect, IsReplaced&& is_replaced) {
  Index k = 0;
  for (const auto& [begin, end] : positions)
    for (Index position = begin; position < end; ++position, ++k) {
      const auto p = static_cast<std::size_t>(position);
      const double d = inverse_d_[p], e = inverse_e_[p];
      if (e != 0) {
        const PivotPair pair = pair_of_pivots(d, e, inverse_d_[p + 1]);
        judge(position, pair.value[0], suspect);
        judge(++position, pair.value[1], suspect);
        ++k;
      } else if (!is_replaced(k)) {
        judge(position, 1 / d, suspect);
      }
    }
}

template <class T>
void PivotRecord<T>::copy_from(const PivotRecord& other, Index begin, Index count) {
  if (kind_ != Kind::ldlt) return;
  std::copy_n(other.inverse_d_.begin() + begin, count, inverse_d_.begin() + begin);
  std::copy_n(other.inverse_e_.begin() + begin, count, inverse_e_.begin() + begin);
}

template <class T>
FactorOutcome PivotRecord<T>::outcome() {
  std::sort(outcome_.replaced.begin(), outcome_.replaced.end());
  std::sort(outcome_.small.begin(), outcome_.small.end());
  std::sort(outcome_.failed.begin(), outcome_.failed.end());
  outcome_.determinant_sign = determinant_.sign();
  outcome_.determinant_log = determinant_.log();
  return outcome_;
}

template class PivotRecord<double>;
template class PivotRecord<float>;

}  // namespace espalier::device::cuda
