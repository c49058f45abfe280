/// \file
/// Complex systems around which changes are made, and their entries.
#pragma once

#include <gtest/gtest.h>

#include <span>
#include <vector>

#include "base/at.hpp"
#include "espalier/changed_system.hpp"
#include "solver/complex_common.hpp"

namespace espalier::test::complex_changes {

/// How A is given, and what a row is that is left out.
struct Given {
  Sort sort;
  Storage storage;
  Kind kind;
  bool hermitian;
};
inline const Given kGiven[] = {
    {Sort::general, Storage::general, Kind::lu, false},
    {Sort::general, Storage::general, Kind::automatic, false},
    {Sort::symmetric, Storage::symmetric_lower, Kind::ldlt, false},
    {Sort::symmetric, Storage::symmetric_upper, Kind::automatic, false},
    {Sort::symmetric, Storage::symmetric_both, Kind::automatic, false},
    {Sort::symmetric, Storage::general, Kind::ldlt, false},
    {Sort::symmetric, Storage::symmetric_lower, Kind::lu, false},
    {Sort::hermitian, Storage::hermitian_lower, Kind::ldlt, true},
    {Sort::hermitian, Storage::hermitian_upper, Kind::automatic, true},
    {Sort::hermitian, Storage::hermitian_both, Kind::automatic, true},
    {Sort::hermitian, Storage::general, Kind::automatic, true},
    {Sort::hermitian, Storage::hermitian_lower, Kind::lu, false},
    {Sort::definite, Storage::hermitian_lower, Kind::llt, true},
    {Sort::definite, Storage::hermitian_upper, Kind::automatic, true},
};

/// Entries of a dense matrix's columns, the largest place first, and one of them in two parts.
struct Entries {
  std::vector<Offset> ptr{0};
  std::vector<Index> rows;
  std::vector<Value> values;

  explicit Entries(const Dense& columns) {
    for (Index c = 0; c < columns.cols(); ++c) {
      for (auto i = static_cast<Index>(columns.rows()); i-- > 0;) {
        const Value v = columns(i, c);
        if (v == Value(0)) continue;
        for (const double part : {0.25, 0.75}) {
          rows.push_back(i);
          values.push_back(i % 3 == 0 ? v * part : part < 0.5 ? Value(0) : v);
        }
      }
      ptr.push_back(static_cast<Offset>(rows.size()));
    }
  }
  [[nodiscard]] ComplexSparseColumns view() const { return {ptr, rows, values}; }
};

inline std::span<const Value> numbers(const Dense& a) { return {a.data(), at(static_cast<Index>(a.size()))}; }

inline ComplexSolver factorized(const ComplexSparseMatrix& a, Kind kind, int threads = 2) {
  Options o;
  o.device = "cpu";
  o.kind = kind;
  o.threads = threads;
  ComplexSolver s(o);
  EXPECT_TRUE(s.analyze(a).status.ok());
  const ComplexFactorResult f = s.factorize(a);
  EXPECT_TRUE(f.status.ok()) << f.status.message;
  return s;
}

inline double smallest_over_largest(const Dense& a) {
  if (a.size() == 0) return 1;
  const Eigen::VectorXd s = Eigen::JacobiSVD<Dense>(a).singularValues();
  return s[s.size() - 1] / s[0];
}

}  // namespace espalier::test::complex_changes
