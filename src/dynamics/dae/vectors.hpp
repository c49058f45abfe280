/// \file
/// Loops over vectors as long as the state, on the threads of a pool. Sums are made in blocks of a fixed length, which
/// are then added up in their order: any number of threads gives the same bits. Short vectors stay with the calling
/// thread, which is done before others have woken up.
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <span>
#include <vector>

#include "base/at.hpp"
#include "base/parallel.hpp"

namespace espalier::dynamics {

/// Entries of a block: four vectors of them stay in a core's second cache.
inline constexpr std::int64_t kVectorBlock = 4096;
/// Vectors below this length are left to the calling thread: about 10 microseconds for three of them.
inline constexpr std::int64_t kLongVector = 4 * kVectorBlock;

/// body(begin, end) over the blocks of [0, n). @param pool  null: the calling thread alone
template <class Body>
void for_each_block(base::ThreadPool* pool, std::size_t n, const Body& body) {
  const auto length = static_cast<std::int64_t>(n);
  base::for_each_range(length < kLongVector ? nullptr : pool, length, kVectorBlock,
                       [&](std::int64_t begin, std::int64_t end) { body(at(begin), at(end)); });
}

/// body(i) for each i in [0, n), in any order.
template <class Body>
void for_each_entry(base::ThreadPool* pool, std::size_t n, const Body& body) {
  for_each_block(pool, n, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) body(i);
  });
}

/// What part(begin, end) says of each block of [0, n), combined from the first to the last: combine(sum, next). A
/// default Result stands for nothing.
template <class Result, class Partial, class Combine>
[[nodiscard]] Result reduce_blocks(base::ThreadPool* pool, std::size_t n, const Partial& part, const Combine& combine) {
  Result all{};
  if (n <= at(kVectorBlock)) {
    combine(all, part(std::size_t{0}, n));
    return all;
  }
  std::vector<Result> parts((n + kVectorBlock - 1) / kVectorBlock);
  for_each_block(pool, n, [&](std::size_t begin, std::size_t end) { parts[begin / kVectorBlock] = part(begin, end); });
  for (const Result& next : parts) combine(all, next);
  return all;
}

/// The sum of term(i) for i in [begin, end), in this order: inside of a block.
template <class Term>
[[nodiscard]] double sum_in_order(std::size_t begin, std::size_t end, const Term& term) {
  double sum = 0;
  for (std::size_t i = begin; i < end; ++i) sum += term(i);
  return sum;
}

/// The largest absolute value; a NaN is larger than all. Bits of numbers without their sign rise with the numbers.
class LargestValue {
 public:
  void include(double x) { bits_ = std::max(bits_, std::bit_cast<std::uint64_t>(x) & ~kSign); }
  void include(const LargestValue& other) { bits_ = std::max(bits_, other.bits_); }
  [[nodiscard]] double value() const { return std::bit_cast<double>(bits_); }

 private:
  static constexpr std::uint64_t kSign = std::uint64_t{1} << 63;
  std::uint64_t bits_ = 0;
};

/// The sum of term(i) over [0, n).
template <class Term>
[[nodiscard]] double sum_of(base::ThreadPool* pool, std::size_t n, const Term& term) {
  return reduce_blocks<double>(
      pool, n, [&](std::size_t begin, std::size_t end) { return sum_in_order(begin, end, term); },
      [](double& sum, double next) { sum += next; });
}

/// The largest |term(i)| over [0, n); NaN where one is NaN; 0 where there are none. Calls term once for each i.
template <class Term>
[[nodiscard]] double largest_of(base::ThreadPool* pool, std::size_t n, const Term& term) {
  return reduce_blocks<LargestValue>(
             pool, n,
             [&](std::size_t begin, std::size_t end) {
               LargestValue largest[2];
               std::size_t i = begin;
               for (; i + 2 <= end; i += 2)
                 for (std::size_t k = 0; k < 2; ++k) largest[k].include(term(i + k));
               for (; i < end; ++i) largest[0].include(term(i));
               largest[0].include(largest[1]);
               return largest[0];
             },
             [](LargestValue& all, const LargestValue& next) { all.include(next); })
      .value();
}

/// Largest absolute value; a NaN gets through; 0 for an empty span.
[[nodiscard]] inline double max_norm(base::ThreadPool* pool, std::span<const double> x) {
  return largest_of(pool, x.size(), [x](std::size_t i) { return x[i]; });
}

/// to = from. @pre as long as each other; they do not overlap unless they are the same
inline void copy(base::ThreadPool* pool, std::span<const double> from, std::span<double> to) {
  if (from.data() == to.data()) return;
  for_each_block(pool, from.size(), [&](std::size_t begin, std::size_t end) {
    std::copy(from.begin() + static_cast<std::ptrdiff_t>(begin), from.begin() + static_cast<std::ptrdiff_t>(end),
              to.begin() + static_cast<std::ptrdiff_t>(begin));
  });
}

inline void fill_zero(base::ThreadPool* pool, std::span<double> x) {
  for_each_block(pool, x.size(), [&](std::size_t begin, std::size_t end) {
    std::fill(x.begin() + static_cast<std::ptrdiff_t>(begin), x.begin() + static_cast<std::ptrdiff_t>(end), 0.0);
  });
}

}  // namespace espalier::dynamics
