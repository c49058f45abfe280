/// \file
/// With -DESPALIER_MARGINS=ON each test program writes what its assertions left of their bounds: for EXPECT_LT,
/// EXPECT_LE and EXPECT_NEAR of floating-point numbers a line "value/bound <tab> test <tab> expressions" is appended to
/// the file that ESPALIER_MARGINS_FILE names. A bound that is nearly reached, and by another share on another
/// instruction set, is one that a machine gave and no theory (docs/design/tests.md). Included before every test
/// (-include).
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <type_traits>

namespace espalier::margins {

inline void note(double value, double bound, const char* left, const char* right) {
  static std::FILE* const file = [] {
    const char* name = std::getenv("ESPALIER_MARGINS_FILE");
    return name == nullptr ? nullptr : std::fopen(name, "a");
  }();
  const auto* test = ::testing::UnitTest::GetInstance()->current_test_info();
  if (file == nullptr || test == nullptr || !(bound > 0) || !(value > 0)) return;
  std::fprintf(file, "%.6g\t%s.%s\t%s | %s\n", value / bound, test->test_suite_name(), test->name(), left, right);
  std::fflush(file);
}

template <class A, class B>
void note_order(const A& a, const B& b, const char* left, const char* right) {
  if constexpr (std::is_floating_point_v<A> && std::is_arithmetic_v<B>)
    note(static_cast<double>(a), static_cast<double>(b), left, right);
}

template <class A, class B>
::testing::AssertionResult less(const char* left, const char* right, const A& a, const B& b) {
  note_order(a, b, left, right);
  return ::testing::internal::CmpHelperLT(left, right, a, b);
}

template <class A, class B>
::testing::AssertionResult less_equal(const char* left, const char* right, const A& a, const B& b) {
  note_order(a, b, left, right);
  return ::testing::internal::CmpHelperLE(left, right, a, b);
}

inline ::testing::AssertionResult near(const char* left, const char* right, const char* bound_text, double a, double b,
                                       double bound) {
  note(std::abs(a - b), bound, left, bound_text);
  return ::testing::internal::DoubleNearPredFormat(left, right, bound_text, a, b, bound);
}

}  // namespace espalier::margins

#undef EXPECT_LT
#undef EXPECT_LE
#undef EXPECT_NEAR
#define EXPECT_LT(a, b) EXPECT_PRED_FORMAT2(::espalier::margins::less, a, b)
#define EXPECT_LE(a, b) EXPECT_PRED_FORMAT2(::espalier::margins::less_equal, a, b)
#define EXPECT_NEAR(a, b, bound) EXPECT_PRED_FORMAT3(::espalier::margins::near, a, b, bound)
