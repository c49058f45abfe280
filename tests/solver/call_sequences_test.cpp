// A share of the campaign of random sequences of calls (tests/verdict/sequence_campaign.cpp): no solution but that of
// the last values. Truth: residuals without refinement, and the bits of fresh factors.
#include "verdict/call_sequences.hpp"

#include <gtest/gtest.h>

#include "solver/as_real_form.hpp"

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

// As GPUs do it. Every fourth sequence is of a complex system.
TEST(CallSequences, NorAreThoseOfRealForms) {
  const test::AsRealForm as_real_form;
  int solutions = 0;
  for (std::uint64_t seed = 3; seed <= 80; seed += 4) {
    const verdict::SequenceVerdict v = verdict::run_sequence(seed, 30);
    EXPECT_EQ(v.wrong, "") << "ESPALIER_COMPLEX_FORM=real espalier_sequences 1 " << seed << " 30";
    solutions += v.solutions;
  }
  EXPECT_GT(solutions, 100);
}

}  // namespace call_sequences_test
}  // namespace espalier
