/// \file
/// Random sequences of calls on one solver and its clones, good ones and bad ones: a solution belongs to the values of
/// the last factorization that succeeded, or there is an error. For a short share in test_solver and for the campaign
/// (tests/verdict/sequence_campaign.cpp).
#pragma once

#include <cstdint>
#include <string>

namespace espalier::verdict {

/// What one sequence came to; `wrong` is empty where all was as it should be.
struct SequenceVerdict {
  std::string wrong;
  int calls = 0;
  int solutions = 0;  ///< judged, by the residual of the values that they should belong to
  int bits = 0;       ///< of them compared with those of a fresh factor, too
  int errors = 0;     ///< calls that had to end in an error, and did
};

/// A sequence of `calls` calls, on real or complex numbers, with options, matrix and calls by the seed.
/// @param device  of all solvers; empty: of the host, by the seed
SequenceVerdict run_sequence(std::uint64_t seed, int calls, const std::string& device = {});

}  // namespace espalier::verdict
