/// \file
/// Random factors in the CUDA backend's layout, and substitution with them by plain loops over the elements, whose
/// places are those of device/cuda/tables/tables.hpp.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "analysis/ordering.hpp"
#include "device/cuda/tables/device_plan.hpp"
#include "matrix/generators/generate.hpp"
#include "parameters.hpp"

namespace espalier {
namespace random_store {

using device::cuda::Front;

struct Parameter {
  std::vector<std::string> words;
  Kind kind;
  Index columns;
  friend void PrintTo(const Parameter& p, std::ostream* out) {
    test::print(*out, p.words, p.kind) << " for " << p.columns;
  }
};

class RandomStore : public ::testing::TestWithParam<Parameter> {
 protected:
  void SetUp() override {
    const SparseMatrix a = matrix::generate(matrix::parse_generator(GetParam().words), &pool_);
    device::cuda::DeviceTuning tuning;
    tuning.narrow_rows = 150;
    auto tree = analysis::build_tree(analysis::graph_of(a, pool_), {}, pool_);
    plan_ = plan::make_plan(std::move(tree), a, {}, device::cuda::cuda_plan_options(GetParam().kind, tuning), pool_);
    device_ = device::cuda::make_device_plan(plan_, GetParam().kind);
    fill_factors();
  }

  // Random numbers of about 1 / sqrt(rows), so that nothing grows; zero where the padding is.
  void fill_factors() {
    Offset at = 0;
    for (auto* list : {&first_, &second_})
      for (const Front& f : device_.fronts) {
        list->push_back(at);
        at += f.factor_size();
      }
    store_.assign(static_cast<std::size_t>(at), 0);
    std::mt19937_64 random(3);
    std::uniform_real_distribution<double> uniform(-1, 1);
    for (const auto* list : {&first_, &second_})
      for (Index f = 0; f < plan_.fronts(); ++f) {
        const Front& x = device_.fronts[f];
        const double size = 1 / std::sqrt(static_cast<double>(x.total_pad));
        for (int c = 0; c < x.pivot_pad; ++c)
          for (int r = c / x.width * x.width; r < x.total_pad; ++r)
            if (real(x, r) && c < x.pivots) store_[place((*list)[f], x, r, c)] = size * uniform(random);
      }
    for (Index k = 0; k < plan_.tree.n; ++k) d_.push_back(1 + 0.5 * uniform(random));
    e_.assign(d_.size(), 0);
    for (const Front& x : device_.fronts)
      for (int k = 0; k + 1 < x.pivots; k += 5)
        if (k / x.width == (k + 1) / x.width) e_[static_cast<std::size_t>(x.position + k)] = 0.3;
  }

  static bool real(const Front& x, int r) { return r < x.pivots || (r >= x.pivot_pad && r - x.pivot_pad < x.below); }
  static std::size_t place(Offset begin, const Front& x, int r, int c) {
    return static_cast<std::size_t>(begin + x.chunk_offset(c / device::cuda::kChunk, r / 8 * 8) +
                                    device::cuda::fragment_offset(r % 8, c % 16));
  }

  // Row r of the front as a position of the whole system.
  [[nodiscard]] Index position(Index f, int r) const {
    const Front& x = device_.fronts[f];
    return r < x.pivots ? x.position + r : plan_.tree.rows[plan_.tree.row_ptr[f] + r - x.pivot_pad];
  }

  // One right-hand side by plain loops.
  void reference(std::vector<double>& x, bool transpose) const {
    const bool lu = GetParam().kind == Kind::lu;
    for (Index f = 0; f < plan_.fronts(); ++f) up(f, lu && transpose ? second_[f] : first_[f], x);
    if (GetParam().kind == Kind::ldlt) middle(x);
    for (Index f = plan_.fronts() - 1; f >= 0; --f) down(f, lu && !transpose ? second_[f] : first_[f], x);
  }
  void up(Index f, Offset begin, std::vector<double>& x) const {
    const Front& t = device_.fronts[f];
    for (int j = 0; j < t.pivot_tiles; ++j) {
      const int b = t.column_begin(j), e = std::min(t.column_end(j), t.pivots);
      std::vector<double> y;
      for (int r = b; r < e; ++r) {
        double sum = 0;
        for (int c = b; c < e; ++c) sum += store_[place(begin, t, r, c)] * x[position(f, c)];
        y.push_back(sum);
      }
      for (int r = b; r < e; ++r) x[position(f, r)] = y[static_cast<std::size_t>(r - b)];
      for (int r = t.column_end(j); r < t.total_pad; ++r)
        for (int c = b; real(t, r) && c < e; ++c)
          x[position(f, r)] -= store_[place(begin, t, r, c)] * y[static_cast<std::size_t>(c - b)];
    }
  }
  void middle(std::vector<double>& x) const {
    for (std::size_t k = 0; k < x.size(); ++k) {
      if (e_[k] == 0) {
        x[k] *= d_[k];
        continue;
      }
      const double a = x[k], b = x[k + 1];
      x[k] = d_[k] * a + e_[k] * b;
      x[k + 1] = e_[k] * a + d_[k + 1] * b;
      ++k;
    }
  }
  void down(Index f, Offset begin, std::vector<double>& x) const {
    const Front& t = device_.fronts[f];
    for (int j = t.pivot_tiles - 1; j >= 0; --j) {
      const int b = t.column_begin(j), e = std::min(t.column_end(j), t.pivots);
      for (int c = b; c < e; ++c)
        for (int r = t.column_end(j); r < t.total_pad; ++r)
          if (real(t, r)) x[position(f, c)] -= store_[place(begin, t, r, c)] * x[position(f, r)];
      std::vector<double> y;
      for (int c = b; c < e; ++c) {
        double sum = 0;
        for (int r = b; r < e; ++r) sum += store_[place(begin, t, r, c)] * x[position(f, r)];
        y.push_back(sum);
      }
      for (int c = b; c < e; ++c) x[position(f, c)] = y[static_cast<std::size_t>(c - b)];
    }
  }

  base::ThreadPool pool_{2};
  plan::Plan plan_;
  device::cuda::DevicePlan device_;
  std::vector<double> store_, d_, e_;
  std::vector<Offset> first_, second_;
};

}  // namespace random_store
}  // namespace espalier
