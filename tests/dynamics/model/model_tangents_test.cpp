// Newton's matrix of whole models: every model of the documentation and of the examples that is small enough, at states
// that satisfy nothing. Truth: differences of the residual; an entry is right if those of one of several steps say so,
// to 1e-6 of the largest entry of its row and what rounding of the forces leaves.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "dynamics/dae/products.hpp"
#include "dynamics/model/built_model.hpp"
#include "dynamics/model/model_common.hpp"

namespace espalier::dynamics {
namespace model_tangents_test {

constexpr Index kMostUnknowns = 300;

class Differences {
 public:
  Differences(System& system, const State& s) : system_(system), s_(s), n_(s.v.size()) {}

  /// One part of the matrix: `moved(j, step)` is the state with coordinate j of that part moved.
  template <class Moved>
  void check(const std::string& name, const std::vector<double>& stated, std::size_t columns,
             const std::vector<double>& steps, const Moved& moved) {
    std::vector<double> row_size(n_, 0.0);
    for (std::size_t i = 0; i < n_; ++i)
      for (std::size_t j = 0; j < columns; ++j) row_size[i] = std::max(row_size[i], std::abs(stated[j * n_ + i]));
    for (std::size_t j = 0; j < columns; ++j) {
      std::vector<double> off(n_, std::numeric_limits<double>::infinity()), found(n_);
      for (const double step : steps) {
        const std::vector<double> plus = residual(moved(j, step)), minus = residual(moved(j, -step));
        for (std::size_t i = 0; i < n_; ++i) {
          const double value = (plus[i] - minus[i]) / (2 * step);
          const double rounding = 1e-14 * (std::abs(plus[i]) + size_of(plus)) / step;
          const double over =
              std::abs(value - stated[j * n_ + i]) - 1e-6 * std::max(row_size[i], std::abs(value)) - rounding;
          if (over < off[i]) off[i] = over, found[i] = value;
        }
      }
      for (std::size_t i = 0; i < n_; ++i)
        EXPECT_LE(off[i], 0) << name << " of " << system_.coordinate_name(static_cast<Index>(i)) << " by number " << j
                             << ": " << stated[j * n_ + i] << " stated, " << found[i] << " by differences";
    }
  }

  void tangent(const TangentWeights& weights, const std::string& name, std::vector<double> State::*part,
               const std::vector<double>& steps) {
    const SparsePattern& p = system_.tangent_pattern();
    std::vector<double> w(static_cast<std::size_t>(p.nonzeros())), dense(n_ * n_, 0.0);
    system_.tangent(s_.view(), weights, w);
    for (std::size_t j = 0; j < n_; ++j)
      for (auto k = static_cast<std::size_t>(p.ptr[j]); k < static_cast<std::size_t>(p.ptr[j + 1]); ++k)
        dense[j * n_ + static_cast<std::size_t>(p.ind[k])] += w[k];
    check(name, dense, n_, steps, [&](std::size_t j, double step) {
      State x = s_;
      if (part != nullptr) {
        (x.*part)[j] += step;
        return x;
      }
      std::vector<double> dq(n_, 0.0);
      dq[j] = step;
      system_.retract(s_.q, dq, x.q);
      return x;
    });
  }

  void multipliers(const std::vector<double>& steps) {
    const std::size_t m = s_.lambda.size();
    std::vector<double> dense(m * n_, 0.0);
    const auto add = [&](const SparsePattern& p, const std::vector<double>& values) {
      for (std::size_t r = 0; r < m; ++r)
        for (auto k = static_cast<std::size_t>(p.ptr[r]); k < static_cast<std::size_t>(p.ptr[r + 1]); ++k)
          dense[r * n_ + static_cast<std::size_t>(p.ind[k])] += values[k];
    };
    add(system_.constraint_pattern(), constraint_values(s_));
    if (const SparsePattern* more = system_.multiplier_pattern()) {
      std::vector<double> values(static_cast<std::size_t>(more->nonzeros()));
      system_.multiplier_tangent(s_.view(), values);
      add(*more, values);
    }
    check("F_lambda", dense, m, steps, [&](std::size_t r, double step) {
      State x = s_;
      x.lambda[r] += step;
      return x;
    });
  }

 private:
  [[nodiscard]] std::vector<double> constraint_values(const State& s) const {
    std::vector<double> values(static_cast<std::size_t>(system_.constraint_pattern().nonzeros()));
    system_.constraints(s.t, s.q, {}, {{}, {}, {}, values});
    return values;
  }

  /// F + Phi_q^T lambda.
  [[nodiscard]] std::vector<double> residual(const State& s) const {
    std::vector<double> f(n_);
    system_.residual(s.view(), f);
    if (!s.lambda.empty()) add_transposed(system_.constraint_pattern(), constraint_values(s), s.lambda, f);
    return f;
  }

  static double size_of(const std::vector<double>& f) {
    double size = 0;
    for (const double x : f) size = std::max(size, std::abs(x));
    return size;
  }

  System& system_;
  const State& s_;
  std::size_t n_;
};

TEST(ModelTangents, OfEveryModelInTheDocumentation) {
  int checked = 0;
  for_each_small_model(kMostUnknowns, [&](model::Mechanism& mechanism, const std::string& name) {
    System& system = mechanism.system;
    ++checked;
    for (const double size : {1e-4, 0.03}) {
      SCOPED_TRACE(name + " ... moved by " + std::to_string(size));
      const State s = anywhere(mechanism, 7, size);
      system.update_pattern(s.q);
      Differences of(system, s);
      of.tangent({1, 0, 0}, "F_a", &State::a, {1, 1e3});
      of.tangent({0, 1, 0}, "F_v", &State::v, {1, 1e-2, 1e-4, 1e-6, 1e-8});
      of.tangent({0, 0, 1}, "F_q", nullptr, {1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9});
      if (!s.lambda.empty()) of.multipliers({1e3, 1, 1e-3, 1e-6});
      if (HasFailure()) break;
    }
  });
  EXPECT_GE(checked, 20);
}

}  // namespace model_tangents_test
}  // namespace espalier::dynamics
