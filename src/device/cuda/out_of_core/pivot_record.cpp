#include "device/cuda/out_of_core/pivot_record.hpp"

#include <algorithm>
#include <cstring>

#include "device/cuda/kernels/factor_parameters.hpp"

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
StreamPivots<T>::StreamPivots(Kind kind, Index n) : kind_(kind) {
  if (kind != Kind::ldlt) return;
  inverse_d_.resize(static_cast<std::size_t>(n));
  inverse_e_.resize(static_cast<std::size_t>(n));
}

template <class T>
void StreamPivots<T>::begin() {
  outcome_ = FactorOutcome{};
  determinant_ = Determinant{};
  stopped_ = false;
}

template <class T>
void StreamPivots<T>::take(const ScratchPlaces& at, const Positions& positions, const PivotRule& rule,
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
      if (kind_ != Kind::ldlt) continue;
      inverse_d_[static_cast<std::size_t>(position)] = read<T>(bytes, at.inverse_d + k * kSize);
      inverse_e_[static_cast<std::size_t>(position)] = read<T>(bytes, at.inverse_e + k * kSize);
    }
  outcome_.negative += control(kNegative);
  outcome_.two_by_two += control(kTwoByTwo);
}

template <class T>
void StreamPivots<T>::copy_from(const StreamPivots& other, Index begin, Index count) {
  if (kind_ != Kind::ldlt) return;
  std::copy_n(other.inverse_d_.begin() + begin, count, inverse_d_.begin() + begin);
  std::copy_n(other.inverse_e_.begin() + begin, count, inverse_e_.begin() + begin);
}

template <class T>
FactorOutcome StreamPivots<T>::outcome() {
  std::sort(outcome_.replaced.begin(), outcome_.replaced.end());
  std::sort(outcome_.failed.begin(), outcome_.failed.end());
  outcome_.determinant_sign = determinant_.sign();
  outcome_.determinant_log = determinant_.log();
  return outcome_;
}

template class StreamPivots<double>;
template class StreamPivots<float>;

}  // namespace espalier::device::cuda
