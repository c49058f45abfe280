// Refinement of the parts of a block-diagonal system. Truth: refine() of each part alone, bit by bit.
#include "solve/part_refinement.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <memory>
#include <vector>

#include "reference/reference.hpp"
#include "solve/residual.hpp"

namespace espalier::solve {
namespace {

// Parts on the host, each with an operator of its own.
class HostParts final : public device::PartSpace {
 public:
  explicit HostParts(const std::vector<SparseMatrix>& parts) : rows_(parts.front().cols) {
    for (const SparseMatrix& a : parts) operators_.push_back(std::make_unique<ResidualOperator>(a.view(), pool_));
  }
  [[nodiscard]] const ResidualOperator& part(std::size_t k) const { return *operators_[k]; }

  [[nodiscard]] Index size() const override { return rows_ * static_cast<Index>(operators_.size()); }
  void compute_parts(const device::ResidualColumns& v, std::span<BackwardError> errors, bool transpose) const override {
    for (std::size_t k = 0; k < errors.size(); ++k) {
      const Offset at = rows_ * static_cast<Offset>(k);
      errors[k] =
          part(k % operators_.size()).compute(v.b + at, v.x + at, v.r != nullptr ? v.r + at : nullptr, transpose);
    }
  }
  void copy_parts(const double* from, double* to, Index columns, std::span<const char> taken) const override {
    EXPECT_EQ(taken.size(), operators_.size() * static_cast<std::size_t>(columns));
    for (std::size_t k = 0; k < taken.size(); ++k)
      if (taken[k] != 0) std::copy_n(from + rows_ * static_cast<Offset>(k), rows_, to + rows_ * static_cast<Offset>(k));
  }
  bool add(const double* from, double* to) const override {
    for (Index k = 0; k < size(); ++k) to[k] += from[k];
    return true;
  }
  [[nodiscard]] Vectors vectors(Index, Index columns) const override {
    const auto memory =
        std::make_shared<std::vector<double>>(static_cast<std::size_t>(size()) * static_cast<std::size_t>(columns));
    return {memory->data(), memory};
  }
  // Krylov methods alone would ask for these.
  void compute(std::span<ResidualColumn>, bool) const override { ADD_FAILURE(); }
  void copy(const double*, double*) const override { ADD_FAILURE(); }
  void multiply(const double*, double*, bool) const override { ADD_FAILURE(); }
  void combine(double, const double*, double, double*) const override { ADD_FAILURE(); }
  [[nodiscard]] double dot(const double*, const double*) const override { return std::nan(""); }

 private:
  Index rows_;
  mutable base::ThreadPool pool_{1};
  std::vector<std::unique_ptr<ResidualOperator>> operators_;
};

constexpr Index kRows = 30;

// The inverse of a part with a relative error of `size` in every component.
void solve_wrongly(const SparseMatrix& a, double size, bool transpose, const double* from, double* to) {
  const std::vector<double> x = reference::solve(a, std::vector<double>(from, from + kRows), 1, transpose);
  for (std::size_t k = 0; k < x.size(); ++k) to[k] = x[k] * (1 + (k % 2 == 0 ? size : -size / 3));
}

struct Problem {
  explicit Problem(Index the_columns, bool the_transpose) : columns(the_columns), transpose(the_transpose) {
    for (const double size : {1e-3, 0.0, 0.3, 1e-9, 2.0}) {  // the last one makes every solution worse
      wrong.push_back(size);
      parts.push_back(reference::random_system(kRows, 4, reference::Values::general, wrong.size()));
    }
    b = reference::random_vector(static_cast<std::int64_t>(kRows) * columns * std::ssize(parts), 3);
  }
  [[nodiscard]] Preconditioner inverse() const {
    return [this](const double* from, double* to, Index now) {
      for (std::size_t k = 0; k < parts.size() * static_cast<std::size_t>(now); ++k)
        solve_wrongly(parts[k % parts.size()], wrong[k % parts.size()], transpose,
                      from + kRows * static_cast<Offset>(k), to + kRows * static_cast<Offset>(k));
    };
  }
  Index columns;
  bool transpose;
  std::vector<SparseMatrix> parts;
  std::vector<double> wrong, b;
};

void expect_parts_as_alone(const Problem& p, const RefinementOptions& o) {
  const HostParts space(p.parts);
  std::vector<double> x(p.b.size());
  p.inverse()(p.b.data(), x.data(), p.columns);
  std::vector<double> alone(x);
  std::vector<RefinementResult> results(p.parts.size() * static_cast<std::size_t>(p.columns));
  results.front().steps = 99;  // of a call before
  refine_parts(space, p.inverse(), {p.b.data(), x.data(), p.columns, p.transpose}, o, results);
  for (std::size_t k = 0; k < results.size(); ++k) {
    SCOPED_TRACE(k);
    const std::size_t part = k % p.parts.size(), at = k * kRows;
    const auto m = [&](const double* from, double* to, Index) {
      solve_wrongly(p.parts[part], p.wrong[part], p.transpose, from, to);
    };
    const RefinementResult truth = refine(space.part(part), m, {p.b.data() + at, alone.data() + at, 1, p.transpose}, o);
    EXPECT_EQ(results[k].steps, truth.steps);
    EXPECT_EQ(results[k].error.normwise, truth.error.normwise);
    EXPECT_EQ(results[k].error.componentwise, truth.error.componentwise);
    for (std::size_t i = at; i < at + kRows; ++i) ASSERT_EQ(x[i], alone[i]) << i - at;
  }
}

TEST(PartRefinement, HasTheBitsOfPartsAlone) {
  for (const Index columns : {1, 3})
    for (const bool transpose : {false, true})
      for (const int steps : {0, 1, 40}) {
        SCOPED_TRACE(testing::Message() << columns << " columns, " << steps << " steps, transpose " << transpose);
        RefinementOptions o;
        o.steps = steps;
        expect_parts_as_alone(Problem(columns, transpose), o);
      }
}

TEST(PartRefinement, StepsDifferAndEndWithTheSlowest) {
  const Problem p(1, false);
  const HostParts space(p.parts);
  int calls = 0;
  const Preconditioner exact = p.inverse();
  const Preconditioner m = [&](const double* from, double* to, Index now) {
    ++calls;
    exact(from, to, now);
  };
  std::vector<double> x(p.b.size());
  exact(p.b.data(), x.data(), 1);
  std::vector<RefinementResult> results(p.parts.size());
  RefinementOptions o;
  o.steps = 60;
  o.target = 1e-15;
  refine_parts(space, m, {p.b.data(), x.data(), 1, false}, o, results);
  int most = 0;
  for (const RefinementResult& r : results) most = std::max(most, r.steps);
  EXPECT_EQ(calls, most);
  EXPECT_LE(results[1].steps, 1);
  EXPECT_GE(results[2].steps, 10);
  EXPECT_LE(results[2].error.componentwise, 1e-15);
  EXPECT_GT(results[4].error.componentwise, 1e-3);
}

// One that is not finite is as it was, and the others are refined.
TEST(PartRefinement, OneThatIsNotFiniteDisturbsNobody) {
  Problem p(1, false);
  p.b[2 * kRows] = std::numeric_limits<double>::infinity();
  const HostParts space(p.parts);
  const Preconditioner exact = p.inverse();
  std::vector<double> x(p.b.size());
  exact(p.b.data(), x.data(), 1);
  std::vector<RefinementResult> results(p.parts.size());
  refine_parts(space, exact, {p.b.data(), x.data(), 1, false}, {}, results);
  EXPECT_FALSE(results[2].error.normwise < 1);
  EXPECT_LE(results[0].error.componentwise, 4 * std::numeric_limits<double>::epsilon());
  EXPECT_LE(results[3].error.componentwise, 4 * std::numeric_limits<double>::epsilon());
}

}  // namespace
}  // namespace espalier::solve
