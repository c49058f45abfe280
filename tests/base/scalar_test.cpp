// Truth: the definitions of IEEE 754, and that bytes tell nothing.
#include "base/scalar.hpp"

#include <gtest/gtest.h>

namespace espalier::base {
namespace {

TEST(ScalarTraits, BytesTellNothing) {
  using Single = std::complex<float>;
  using Double = std::complex<double>;
  static_assert(sizeof(Single) == sizeof(double));
  static_assert(keeps_fp64<double> && keeps_fp64<Double>);
  static_assert(!keeps_fp64<float> && !keeps_fp64<Single>);
  static_assert(ScalarTraits<Single>::is_complex && !ScalarTraits<double>::is_complex);
  static_assert(std::is_same_v<ScalarTraits<Single>::Real, float>);
  EXPECT_EQ(ScalarTraits<Double>::epsilon, 0x1p-52);
  EXPECT_EQ(ScalarTraits<Single>::epsilon, 0x1p-23);
}

}  // namespace
}  // namespace espalier::base
