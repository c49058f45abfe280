// What the pivots of units of a factorization out of core came to, without a GPU: a unit that is kept counts as it did.
// Truth: the record of a run that makes all; the definition of each limit.
#include "device/cuda/out_of_core/pivot_record.hpp"

#include <gtest/gtest.h>

#include <cstring>
#include <limits>
#include <random>
#include <vector>

namespace espalier {
namespace pivot_record_test {

using device::FactorOutcome;
using device::PivotRule;
using device::cuda::Control;
using device::cuda::PivotRecord;
using device::cuda::Positions;
using device::cuda::ScratchPlaces;

constexpr Index kPivots = 6;

ScratchPlaces places(Offset size) {
  ScratchPlaces at;
  at.inverse_d = kPivots * size;
  at.inverse_e = 2 * kPivots * size;
  at.replaced = 3 * kPivots * size;
  at.failed = at.replaced + kPivots;
  at.control = (at.failed + kPivots + 3) / 4 * 4;
  at.flags = at.control + 4 * device::cuda::kCounters;
  at.pivots = kPivots;
  return at;
}

PivotRule rule_of(double tiny = 1e-14, double threshold = 0.01, double suspect = 1e-10, double largest = 1) {
  PivotRule rule{threshold, tiny};
  rule.suspect = suspect;
  rule.largest = largest;
  return rule;
}

// What a unit brings. Pivots are about 1 each.
template <class T>
struct Brought {
  ScratchPlaces at = places(sizeof(T));
  std::vector<std::byte> bytes = std::vector<std::byte>(static_cast<std::size_t>(at.flags));

  explicit Brought(unsigned seed) {
    std::mt19937 random(seed);
    for (Index k = 0; k < kPivots; ++k)
      set_pivot(k,
                static_cast<T>(std::uniform_real_distribution<double>(0.5, 2)(random)) * (k % 3 == 0 ? T(-1) : T(1)));
    set(device::cuda::kNegative, 2);
  }
  void write(Offset to, const void* from, std::size_t size) { std::memcpy(bytes.data() + to, from, size); }
  void set_pivot(Index k, T value) {
    const T inverse = 1 / value;
    write(at.pivot + k * static_cast<Offset>(sizeof(T)), &value, sizeof value);
    write(at.inverse_d + k * static_cast<Offset>(sizeof(T)), &inverse, sizeof value);
  }
  void set(Control counter, int value) { write(at.control + 4 * counter, &value, sizeof value); }
};

template <class T>
PivotRecord<T> recorded(Kind kind, const Brought<T>& unit, const PivotRule& rule) {
  PivotRecord<T> record(kind, kPivots);
  record.keep_units(1);
  record.begin();
  record.take(0, unit.at, Positions{{0, kPivots}}, rule, unit.bytes);
  return record;
}

TEST(PivotRecord, KeepsUnitsThatWouldBeJudgedAlike) {
  const PivotRule rule = rule_of();
  for (const Kind kind : {Kind::ldlt, Kind::lu}) {
    const Brought<double> unit(1);
    const PivotRecord<double> record = recorded(kind, unit, rule);
    EXPECT_TRUE(record.stays(0, rule));
    EXPECT_TRUE(record.stays(0, rule_of(1.9e-14))) << "no pivot is near either limit";
    EXPECT_FALSE(record.stays(0, rule_of(2.1e-14)));
    EXPECT_FALSE(record.stays(0, rule_of(0.4e-14)));
    EXPECT_FALSE(record.stays(0, rule_of(1e-14, 0.02))) << "another threshold";
    EXPECT_FALSE(record.stays(0, rule_of(std::numeric_limits<double>::quiet_NaN())));
  }
  const Brought<double> unit(1);
  EXPECT_TRUE(recorded(Kind::llt, unit, rule).stays(0, rule_of(1e-12))) << "judged by its own entry of the matrix";
}

TEST(PivotRecord, LooksAtPivotsThatAnotherRuleMightReplace) {
  const PivotRule rule = rule_of(), other = rule_of(1.5e-14);
  Brought<double> small(2), replaced(2), failed(2), near(2);
  small.set_pivot(3, 1e-11);
  const std::byte one{1};
  replaced.write(replaced.at.replaced + 2, &one, 1);
  failed.write(failed.at.failed + 4, &one, 1);
  near.set(device::cuda::kNear, 1);
  for (const Brought<double>* unit : {&small, &replaced, &failed, &near}) {
    const PivotRecord<double> record = recorded(Kind::ldlt, *unit, rule);
    EXPECT_TRUE(record.stays(0, rule)) << "by the same rule it is the same";
    EXPECT_FALSE(record.stays(0, other));
  }
  EXPECT_FALSE(recorded(Kind::ldlt, Brought<double>(2), rule_of(1e-14, 0.01, 2e-14)).stays(0, other))
      << "who looks for pivots below 2e-14 says nothing of those near 1e-14";
}

// The exponent of the largest entry scales FP32's operands.
TEST(PivotRecord, OfFp32NeedsTheSamePowersOfTwo) {
  const Brought<float> unit(3);
  for (const Kind kind : {Kind::llt, Kind::ldlt, Kind::lu}) {
    const PivotRecord<float> record = recorded(kind, unit, rule_of(1e-9, 0.01, 1e-7, 1.2));
    EXPECT_TRUE(record.stays(0, rule_of(1e-9, 0.01, 1e-7, 1.9)));
    EXPECT_FALSE(record.stays(0, rule_of(1e-9, 0.01, 1e-7, 2.1)));
  }
}

// Units are taken in the same order, whether they were made or kept.
TEST(PivotRecord, CountsKeptUnitsAsIfTheyWereMade) {
  const PivotRule rule = rule_of();
  for (const Kind kind : {Kind::llt, Kind::ldlt, Kind::lu}) {
    PivotRecord<double> some(kind, 2 * kPivots), all(kind, 2 * kPivots);
    some.keep_units(2);
    Brought<double> first(4), second(5), changed(6);
    const std::byte one{1};
    first.write(first.at.failed + 1, &one, 1);
    first.set(device::cuda::kTwoByTwo, 1);
    const Positions of_first{{0, 3}, {6, 9}}, of_second{{3, 6}, {9, 12}};
    some.begin();
    some.take(0, first.at, of_first, rule, first.bytes);
    some.take(1, second.at, of_second, rule, second.bytes);
    for (int round = 0; round < 2; ++round) {
      some.begin();
      some.take(0, first.at, of_first, rule, {});
      some.take(1, changed.at, of_second, rule, round == 0 ? changed.bytes : std::vector<std::byte>());
      all.begin();
      all.take(0, first.at, of_first, rule, first.bytes);
      all.take(1, changed.at, of_second, rule, changed.bytes);
      const FactorOutcome x = some.outcome(), y = all.outcome();
      EXPECT_EQ(x.determinant_log, y.determinant_log);
      EXPECT_EQ(x.determinant_sign, y.determinant_sign);
      EXPECT_EQ(x.negative, y.negative);
      EXPECT_EQ(x.two_by_two, y.two_by_two);
      EXPECT_EQ(x.failed, y.failed);
      EXPECT_EQ(x.failed, std::vector<Index>{1});
      EXPECT_EQ(some.inverse_d(), all.inverse_d());
      EXPECT_TRUE(some.positive());
    }
    if (kind != Kind::llt) continue;
    second.set(device::cuda::kNotPositive, 2);
    some.take(1, second.at, of_second, rule, second.bytes);
    EXPECT_FALSE(some.positive()) << "what is behind it was not made";
  }
}

}  // namespace pivot_record_test
}  // namespace espalier
