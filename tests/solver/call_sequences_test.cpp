// A share of the campaign of random sequences of calls (tests/verdict/sequence_campaign.cpp): no solution but that of
// the last values. Truth: residuals without refinement, and the bits of fresh factors.
#include "verdict/call_sequences.hpp"

#include <gtest/gtest.h>

namespace espalier {
namespace call_sequences_test {

TEST(CallSequences, NoSolutionIsThatOfOldValues) {
  int solutions = 0, bits = 0, errors = 0;
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    const verdict::SequenceVerdict v = verdict::run_sequence(seed, 40);
    EXPECT_EQ(v.wrong, "") << "espalier_sequences 1 " << seed << " 40";
    solutions += v.solutions;
    bits += v.bits;
    errors += v.errors;
  }
  EXPECT_GT(solutions, 500);
  EXPECT_GT(bits, 200);
  EXPECT_GT(errors, 500);
}

}  // namespace call_sequences_test
}  // namespace espalier
