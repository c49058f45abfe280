/// \file
/// What the tests of the solver's public interface share.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "espalier/espalier.hpp"
#include "matrix/generators/generate.hpp"
#include "reference/reference.hpp"
#include "solver/rounding.hpp"

namespace espalier::test {

inline Options two_threads() {
  Options o;
  o.threads = 2;
  return o;
}

/// Asked at every border of work whether to go on.
inline Options options_on(const char* device, int threads, Offset device_memory = 0) {
  Options o;
  o.device = device;
  o.threads = threads;
  o.device_memory_bytes = device_memory;
  o.interrupted_every = 0;
  return o;
}

/// Analyzes, factorizes and solves with random right-hand sides; the independent backward error must be at most
/// 8 eps (refinement ends at the rounding of x; the factor covers the rounding of b and x themselves).
inline void expect_solved(Solver& s, const MatrixView& a, Index columns = 1, Transpose transpose = Transpose::no) {
  const AnalysisResult analysis = s.analyze(a);
  ASSERT_TRUE(analysis.status.ok()) << analysis.status.message;
  const FactorResult factor = s.factorize(a);
  ASSERT_TRUE(factor.status.ok()) << factor.status.message;
  const std::vector<double> b = reference::random_vector(static_cast<std::int64_t>(a.rows) * columns, 77);
  std::vector<double> x(b.size(), std::numeric_limits<double>::quiet_NaN());
  const SolveResult r = s.solve(b, x, columns, transpose);
  EXPECT_TRUE(r.status.ok()) << r.status.message;
  const double error = reference::backward_error(a, b, x, columns, transpose == Transpose::yes);
  EXPECT_LE(error, 8 * kEps);
  EXPECT_LE(std::abs(r.backward_error - error), 0.01 * error + kEps) << "the reported error is not the true one";
}

/// Solves with the factor that is there; the independent backward error must be at most 8 eps.
inline void expect_small_error(Solver& s, const MatrixView& a) {
  const std::vector<double> b = reference::random_vector(a.rows, 31);
  std::vector<double> x(b.size());
  const SolveResult r = s.solve(b, x);
  EXPECT_TRUE(r.status.ok()) << r.status.message;
  EXPECT_LE(reference::backward_error(a, b, x), 8 * kEps);
}

inline void expect_solved(const MatrixView& a, const Options& o = two_threads()) {
  Solver s(o);
  expect_solved(s, a);
}

inline SparseMatrix generated(std::vector<std::string> words) {
  return matrix::generate(matrix::parse_generator(words));
}

inline SparseMatrix diagonal(const std::vector<double>& d) {
  std::vector<reference::Triple> t;
  for (std::size_t k = 0; k < d.size(); ++k) t.push_back({static_cast<Index>(k), static_cast<Index>(k), d[k]});
  return reference::from_triples(static_cast<Index>(d.size()), t, Storage::symmetric_lower);
}

}  // namespace espalier::test
