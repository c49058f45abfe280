// Substitution on the host with factors in the CUDA backend's layout. Truth: the same sums by plain loops over the
// elements, whose places are those of device/cuda/tables.hpp; and one thread gives the bits of several.
#include "device/cuda/out_of_core/store_solve.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "device/block_diagonal.hpp"
#include "device/cuda/out_of_core/part_tables.hpp"
#include "device/cuda/tables/device_plan.hpp"
#include "device/random_store.hpp"

namespace espalier {
namespace store_solve_test {

using device::cuda::Front;

using random_store::Parameter;
using random_store::RandomStore;

class StoreSolve : public RandomStore {
 protected:
  std::vector<double> solved(int threads, const std::vector<double>& rhs, bool transpose) {
    base::ThreadPool pool(threads);
    device::cuda::StoreSolve<double> solve(plan_, device_.fronts, GetParam().kind, pool);
    std::vector<double> x = rhs;
    solve.run({store_.data(), &first_, &second_, &d_, &e_}, x.data(), GetParam().columns, transpose);
    return x;
  }
};

TEST_P(StoreSolve, SumsAreThoseOfPlainLoops) {
  const Index n = plan_.tree.n, columns = GetParam().columns;
  std::vector<double> rhs(static_cast<std::size_t>(n) * columns);
  for (std::size_t k = 0; k < rhs.size(); ++k) rhs[k] = std::cos(static_cast<double>(k));
  for (const bool transpose : {false, true}) {
    const std::vector<double> x = solved(1, rhs, transpose);
    for (Index c = 0; c < columns; ++c) {
      std::vector<double> y(static_cast<std::size_t>(n));
      for (Index k = 0; k < n; ++k) y[k] = rhs[static_cast<std::size_t>(k) * columns + c];
      reference(y, transpose);
      double most = 0, size = 0;
      for (Index k = 0; k < n; ++k) {
        most = std::max(most, std::abs(y[k] - x[static_cast<std::size_t>(k) * columns + c]));
        size = std::max(size, std::abs(y[k]));
      }
      EXPECT_LE(most, 1e3 * std::numeric_limits<double>::epsilon() * std::sqrt(static_cast<double>(n)) * size);
    }
    const std::vector<double> many = solved(3, rhs, transpose);
    EXPECT_EQ(std::memcmp(x.data(), many.data(), x.size() * sizeof(double)), 0);
  }
}

/// Fronts on the way from some rows to the roots; and right-hand sides with entries in these rows.
struct Paths {
  std::vector<char> up, down;
  std::vector<Index> given, wanted;
  std::vector<double> b, x, rhs;
  Index columns;

  Paths(const plan::Plan& plan, Index the_columns, unsigned seed) : columns(the_columns) {
    const auto fronts = static_cast<std::size_t>(plan.fronts());
    up.resize(fronts);
    down.resize(fronts);
    std::mt19937 random(seed);
    const auto choose = [&](std::vector<Index>& rows, std::vector<char>& marks) {
      for (unsigned k = random() % 4; k > 0; --k) rows.push_back(static_cast<Index>(random() % unsigned(plan.tree.n)));
      std::sort(rows.begin(), rows.end());
      rows.erase(std::unique(rows.begin(), rows.end()), rows.end());
      for (const Index row : rows) {
        const auto& first = plan.tree.first;
        auto f = static_cast<Index>(std::upper_bound(first.begin(), first.end(), row) - first.begin()) - 1;
        for (; f >= 0; f = plan.tree.parent[f]) marks[static_cast<std::size_t>(f)] = 1;
      }
    };
    choose(given, up);
    choose(wanted, down);
    rhs.assign(static_cast<std::size_t>(plan.tree.n) * static_cast<std::size_t>(columns), 0);
    for (const Index row : given)
      for (Index c = 0; c < columns; ++c) {
        b.push_back(std::cos(static_cast<double>(row + 7 * c)));
        rhs[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns) + static_cast<std::size_t>(c)] = b.back();
      }
    x.resize(wanted.size() * static_cast<std::size_t>(columns));
  }
  [[nodiscard]] device::PathSolve<double> solve(bool transpose) {
    return {{up, down}, given, b.data(), wanted, x.data(), columns, transpose};
  }
  void expect_rows_of(const std::vector<double>& whole) const {
    for (std::size_t k = 0; k < wanted.size(); ++k)
      for (std::size_t c = 0; c < static_cast<std::size_t>(columns); ++c)
        EXPECT_EQ(x[k * static_cast<std::size_t>(columns) + c],
                  whole[static_cast<std::size_t>(wanted[k]) * static_cast<std::size_t>(columns) + c]);
  }
};

// Truth: whole solves, to the last bit. What is not on a path is no number.
TEST_P(StoreSolve, OnPathsNothingElseIsRead) {
  const Index columns = GetParam().columns;
  base::ThreadPool pool(3);
  for (unsigned seed = 0; seed < 12; ++seed) {
    Paths paths(plan_, columns, seed);
    std::vector<double> poisoned = store_;
    for (const auto* list : {&first_, &second_})
      for (std::size_t f = 0; f < list->size(); ++f)
        if (paths.up[f] == 0 && paths.down[f] == 0)
          std::fill_n(poisoned.begin() + (*list)[f], device_.fronts[f].factor_size(), std::nan(""));
    for (const bool transpose : {false, true}) {
      device::cuda::StoreSolve<double> solve(plan_, device_.fronts, GetParam().kind, pool);
      std::vector<double> ones(paths.rhs.size(), 1);  // leaves other numbers where updates were
      solve.run({store_.data(), &first_, &second_, &d_, &e_}, ones.data(), columns, transpose);
      solve.run({poisoned.data(), &first_, &second_, &d_, &e_}, paths.solve(transpose));
      std::vector<double> whole = paths.rhs;
      solve.run({store_.data(), &first_, &second_, &d_, &e_}, whole.data(), columns, transpose);
      paths.expect_rows_of(whole);
    }
  }
}

// The GPU's part by plain loops over the tables that it gets, task by task in their order: what a task needs must have
// been made by one before it.
class PlainPart : public device::cuda::Companion<double> {
 public:
  PlainPart(const plan::Plan& plan, Kind kind, const device::cuda::PartTables& tables, const double* store,
            const std::vector<double>& d, const std::vector<double>& e)
      : plan_(plan), kind_(kind), t_(tables), store_(store) {
    for (const Index f : t_.part)
      for (Index p = plan.tree.first[f]; p < plan.tree.first[f + 1]; ++p) {
        d_.push_back(d[static_cast<std::size_t>(p)]);
        e_.push_back(e[static_cast<std::size_t>(p)]);
      }
  }
  void start(const double* x, Index, bool transpose) override {
    transpose_ = transpose;
    rhs_.assign(static_cast<std::size_t>(t_.pivots), 0);
    forward_ = solution_ = rhs_;
    updates_.assign(static_cast<std::size_t>(t_.updates), std::nan(""));
    over_pivots([&](std::size_t here, std::size_t there) { rhs_[here] = x[there]; });
    way_up(t_.streamed);
  }
  void turn(double* x, const double* updates, Index) override {
    auto to = updates_.begin() + static_cast<std::ptrdiff_t>(t_.child_updates);
    for (const Index f : t_.children)
      to = std::copy(updates + plan_.tree.row_ptr[f], updates + plan_.tree.row_ptr[f + 1], to);
    EXPECT_EQ(to, updates_.end());
    way_up(t_.resident);
    way_down(t_.resident);
    over_pivots([&](std::size_t here, std::size_t there) { x[there] = solution_[here]; });
    way_down(t_.streamed);
  }
  void finish(double* x, Index) override {
    over_pivots([&](std::size_t here, std::size_t there) { x[there] = solution_[here]; });
  }
  [[nodiscard]] Index most_columns() const override { return 1; }

 private:
  template <class Use>
  void over_pivots(Use&& use) const {
    for (std::size_t k = 0; k < t_.part.size(); ++k)
      for (Index p = 0; p < t_.fronts[k].pivots; ++p)
        use(static_cast<std::size_t>(t_.fronts[k].position + p),
            static_cast<std::size_t>(plan_.tree.first[t_.part[k]] + p));
  }
  [[nodiscard]] double at(const Front& x, bool second, int r, int c) const {
    const Offset begin = second ? x.second : x.factor;
    return store_[begin + x.chunk_offset(c / device::cuda::kChunk, r / 8 * 8) +
                  device::cuda::fragment_offset(r % 8, c % 16)];
  }
  // A front when its last task comes.
  void way_up(const device::cuda::PartTables::Tasks& tasks) {
    for (int k = tasks.up; k < tasks.up + tasks.ups; ++k)
      if (k + 1 == tasks.up + tasks.ups || t_.up[static_cast<std::size_t>(k) + 1].front != t_.up[k].front)
        up(t_.fronts[static_cast<std::size_t>(t_.up[k].front)]);
  }
  void way_down(const device::cuda::PartTables::Tasks& tasks) {
    for (int k = tasks.down; k < tasks.down + tasks.downs; ++k)
      if (k + 1 == tasks.down + tasks.downs || t_.down[static_cast<std::size_t>(k) + 1].front != t_.down[k].front)
        down(t_.fronts[static_cast<std::size_t>(t_.down[k].front)]);
  }
  void up(const Front& x) {
    const bool second = kind_ == Kind::lu && transpose_;
    std::vector<double> v(static_cast<std::size_t>(x.total_pad), 0);
    std::copy_n(rhs_.begin() + x.position, x.pivots, v.begin());
    for (int l = x.link_begin; l < x.link_end; ++l) {
      const Front& child = t_.fronts[static_cast<std::size_t>(t_.links[l].child)];
      EXPECT_EQ(t_.bounds[t_.links[l].bound + x.tiles], child.below);
      for (int r = 0; r < child.below; ++r) {
        const int to = t_.relative[child.rows + r];
        v[static_cast<std::size_t>(to < x.pivots ? to : to - x.pivots + x.pivot_pad)] += updates_[child.rows + r];
      }
    }
    for (int j = 0; j < x.pivot_tiles; ++j) {
      const int b = x.column_begin(j), e = x.column_end(j);
      std::vector<double> y(static_cast<std::size_t>(e - b), 0);
      for (int r = b; r < e; ++r)
        for (int c = b; c < e; ++c) y[static_cast<std::size_t>(r - b)] += at(x, second, r, c) * v[c];
      for (int r = e; r < x.total_pad; ++r)
        for (int c = b; c < e; ++c) v[r] -= at(x, second, r, c) * y[static_cast<std::size_t>(c - b)];
      for (int r = b; r < std::min(e, x.pivots); ++r) forward_[x.position + r] = y[static_cast<std::size_t>(r - b)];
    }
    std::copy_n(v.begin() + x.pivot_pad, x.below, updates_.begin() + x.rows);
  }
  void down(const Front& x) {
    const bool second = kind_ == Kind::lu && !transpose_;
    std::vector<double> v(static_cast<std::size_t>(x.total_pad), 0);
    std::copy_n(forward_.begin() + x.position, x.pivots, v.begin());
    if (kind_ == Kind::ldlt)
      device::apply_inverse_d(d_.data() + x.position, e_.data() + x.position, x.pivots, 1, v.data());
    for (int r = 0; r < x.below; ++r) v[x.pivot_pad + r] = solution_[t_.rows[x.rows + r]];
    for (int j = x.pivot_tiles - 1; j >= 0; --j) {
      const int b = x.column_begin(j), e = x.column_end(j);
      for (int c = b; c < e; ++c)
        for (int r = e; r < x.total_pad; ++r) v[c] -= at(x, second, r, c) * v[r];
      std::vector<double> y(static_cast<std::size_t>(e - b), 0);
      for (int c = b; c < e; ++c)
        for (int r = b; r < e; ++r) y[static_cast<std::size_t>(c - b)] += at(x, second, r, c) * v[r];
      std::copy(y.begin(), y.end(), v.begin() + b);
    }
    std::copy_n(v.begin(), x.pivots, solution_.begin() + x.position);
  }

  const plan::Plan& plan_;
  Kind kind_;
  const device::cuda::PartTables& t_;
  const double* store_;
  std::vector<double> d_, e_, rhs_, forward_, solution_, updates_;
  bool transpose_ = false;
};

// The top of the tree as if it were resident, one sub-tree below it as if it streamed, the rest on the host.
TEST_P(StoreSolve, APartElsewhereGivesTheSameSums) {
  const Index n = plan_.tree.n, fronts = plan_.fronts();
  out_of_core::OutOfCorePlan places;
  places.factor_store = first_;
  places.factor2_store = second_;
  places.resident_at.assign(static_cast<std::size_t>(fronts), {-1, -1});
  for (Index f = 0; f < fronts; ++f)
    if (plan_.tier[f] <= 1) {
      places.resident.push_back(f);
      places.resident_at[f] = {first_[f] * 8, second_[f] * 8};  // the test's arena is its store
    }
  std::vector<char> streamed(static_cast<std::size_t>(fronts), 0);
  for (Index f = fronts - 1, roots = 0; f >= 0; --f) {
    const Index parent = plan_.tree.parent[f];
    if (plan_.tier[f] == 2 && roots++ == 0) streamed[f] = 1;
    if (plan_.tier[f] > 2 && streamed[parent] != 0) streamed[f] = 1;
  }
  for (Index f = 0; f < fronts; ++f)
    if (streamed[f] != 0) places.streamed.push_back(f);
  ASSERT_GT(places.streamed.size(), 1U);
  ASSERT_GT(fronts - static_cast<Index>(places.resident.size() + places.streamed.size()), 0);
  std::vector<double> rhs(static_cast<std::size_t>(n));
  for (std::size_t k = 0; k < rhs.size(); ++k) rhs[k] = std::cos(static_cast<double>(k));
  const device::cuda::OutOfCoreTables tables(plan_, GetParam().kind, 8);
  for (const bool with_streamed : {false, true})
    for (const bool transpose : {false, true}) {
      const device::cuda::PartTables part(plan_, tables, places, with_streamed);
      EXPECT_LE(part.places(GetParam().kind, 8, 1).bytes,
                device::cuda::PartTables::most_bytes(plan_, tables, part.part, 8, 1));
      PlainPart companion(plan_, GetParam().kind, part, store_.data(), d_, e_);
      device::cuda::StoreSolve<double> solve(plan_, device_.fronts, GetParam().kind, pool_);
      solve.share(part.part, &companion);
      std::vector<double> x = rhs, y = rhs;
      solve.run({store_.data(), &first_, &second_, &d_, &e_}, x.data(), 1, transpose);
      reference(y, transpose);
      double most = 0, size = 0;
      for (std::size_t k = 0; k < x.size(); ++k) {
        most = std::max(most, std::abs(y[k] - x[k]));
        size = std::max(size, std::abs(y[k]));
      }
      EXPECT_LE(most, 1e3 * std::numeric_limits<double>::epsilon() * std::sqrt(static_cast<double>(n)) * size);
      for (unsigned seed = 0; seed < 8; ++seed) {
        Paths paths(plan_, 1, seed);
        solve.run({store_.data(), &first_, &second_, &d_, &e_}, paths.solve(transpose));
        std::vector<double> whole = paths.rhs;
        solve.run({store_.data(), &first_, &second_, &d_, &e_}, whole.data(), 1, transpose);
        paths.expect_rows_of(whole);
      }
    }
}

INSTANTIATE_TEST_SUITE_P(Systems, StoreSolve,
                         ::testing::Values(Parameter{{"elasticity", "10"}, Kind::llt, 1},
                                           Parameter{{"elasticity", "7"}, Kind::ldlt, 3},
                                           Parameter{{"gyroscopic", "7"}, Kind::lu, 1},
                                           Parameter{{"plate", "30", "30"}, Kind::llt, 11}));

}  // namespace store_solve_test
}  // namespace espalier
