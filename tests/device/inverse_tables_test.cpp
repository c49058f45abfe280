// Entries of an inverse by the tables that a GPU gets, task by task with plain loops. Truth: columns by substitution
// with plain loops over the elements of the factor.
#include "device/cuda/tables/inverse_tables.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "device/random_store.hpp"

namespace espalier {
namespace inverse_tables_test {

using namespace device::cuda;
using random_store::Parameter;
using random_store::RandomStore;

/// Carries out launches in a stack of its own, which holds no number before something is written.
class PlainInverse {
 public:
  using InverseFront = InverseFrontOf<double>;

  PlainInverse(const InverseTables& tables, Kind kind, std::vector<InverseFront> fronts, const std::int32_t* relative,
               const double* d, const double* e)
      : t_(tables), kind_(kind), fronts_(std::move(fronts)), relative_(relative), d_(d), e_(e) {}

  /// read(place): after a front's group is made.
  template <class Bring, class Read>
  void run(Bring&& bring, Read&& read) {
    for (const InverseLaunch& l : t_.launches)
      for (Offset k = l.begin; k < l.end; ++k) {
        if (l.work == InverseWork::bring || l.work == InverseWork::read) {
          l.work == InverseWork::bring ? bring(fronts_[at(k)], t_.spots[at(k)]) : read(fronts_[at(k)], t_.spots[at(k)]);
          continue;
        }
        const InverseTask& task = t_.tasks[at(k)];
        make(l, task, fronts_[at(task.front)]);
      }
  }

 private:
  static std::size_t at(Offset k) { return static_cast<std::size_t>(k); }

  void make(const InverseLaunch& l, const InverseTask& task, const InverseFront& x) {
    const int begin = x.begin_of(task.block), end = x.end_of(task.block), w = end - begin, pad = x.front.total_pad;
    const int rows = kInverseRows[l.shape], cols = kInverseCols[l.shape];
    switch (l.work) {
      case InverseWork::gather:
        return gather(task, x);
      case InverseWork::begin:
        for (int r = 0; r < w; ++r)
          for (int c = 0; c < w; ++c) {
            const Offset to = Offset{begin} * x.widest() + chunked(w, c, r);
            x.m[to] = inverse_element(x, x.factor, task.block, r, c, kind_ == Kind::llt);
            x.v[to] = second_element(x, kind_, d_, e_, task.block, r, c);
          }
        return;
      case InverseWork::solve: {
        double* to = rows_of_block(x, task.block, task.part) + Offset{(task.col - end) / kChunk} * w * kChunk;
        return sum(product_of_solve(x, task, rows, cols),
                   [&](int r, int c, double v) { to[chunked(w, task.row + r, c)] = v; });
      }
      case InverseWork::multiply: {
        double* here = task.part == 0 ? x.z : x.across;
        double* there = task.part == 0 ? x.across : x.z;
        return sum(product_of_multiply(x, task, rows, cols), [&](int r, int c, double v) {
          here[chunked(pad, task.row + r, begin + task.col + c)] = -v;
          there[chunked(pad, begin + task.col + c, task.row + r)] = -v;
        });
      }
      default: {
        std::vector<double> v(static_cast<std::size_t>(rows * cols));
        sum(product_of_diagonal(x, task, rows, cols),
            [&](int r, int c, double y) { v[static_cast<std::size_t>(r * cols + c)] = -y; });
        sum(product_of_inverses(x, task, rows, cols), [&](int r, int c, double y) {
          const int row = begin + task.row + r, col = begin + task.col + c;
          if (kind_ != Kind::lu && row < col) return;
          x.z[chunked(pad, row, col)] = x.across[chunked(pad, col, row)] =
              y + v[static_cast<std::size_t>(r * cols + c)];
        });
      }
    }
  }

  // use(row, column, sum) of A B^T.
  template <class Use>
  static void sum(const InverseProduct<double>& p, Use&& use) {
    for (int r = 0; r < p.rows; ++r)
      for (int c = 0; c < p.cols; ++c) {
        double s = 0;
        for (int q = 0; q < p.chunks; ++q)
          for (int k = 0; k < kChunk; ++k) s += element(p.chunk_a(q), r, k) * element(p.chunk_b(q), c, k);
        use(r, c, s);
      }
  }
  static double element(const double* chunk, int row, int col) {
    return chunk[row / kPanel * 128 + fragment_offset(row % kPanel, col)];
  }

  void gather(const InverseTask& task, const InverseFront& x) const {
    const bool root = x.parent < 0;
    const InverseFront& parent = root ? x : fronts_[at(x.parent)];
    const int pad = x.front.total_pad;
    for (int r = task.row; r < std::min(task.row + kGatherRows, pad); ++r)
      for (int c = task.col; c < task.col + kChunk; ++c) {
        const int row = row_of_parent(x.front, parent.front, relative_, r);
        const int col = row_of_parent(x.front, parent.front, relative_, c);
        const bool there = row >= 0 && col >= 0 && !root;
        const double* from = task.part == 0 ? parent.z : parent.across;
        double* to = task.part == 0 ? x.z : x.across;
        to[chunked(pad, r, c)] = there ? from[chunked(parent.front.total_pad, row, col)] : 0;
      }
  }

  const InverseTables& t_;
  Kind kind_;
  std::vector<InverseFront> fronts_;
  const std::int32_t* relative_;
  const double *d_, *e_;
};

class InverseTasks : public RandomStore {
 protected:
  void SetUp() override {
    RandomStore::SetUp();
    for (Index f = 0; f < plan_.fronts(); ++f) {  // triangles, as a factorization leaves them
      Front& x = device_.fronts[f];
      x.inverted = x.width;
      const auto kind = GetParam().kind;
      if (kind != Kind::ldlt)
        for (int c = 0; c < x.pivots; ++c)
          for (int r = c / x.width * x.width; r < c; ++r)
            store_[place(kind == Kind::llt ? first_[f] : second_[f], x, r, c)] = 0;
    }
  }

  // Joins the inverses of tiles in blocks of rows, as block_inverse.hpp says.
  void join() {
    for (Index f = 0; f < plan_.fronts(); ++f) {
      Front& x = device_.fronts[f];
      if (x.whole != 0) continue;
      for (int b = 0; b < x.pivots; b += kRowBlock) {
        const int e = std::min(b + kRowBlock, x.pivots), w = e - b;
        std::vector<double> inverse(static_cast<std::size_t>(w * w), 0);  // by columns
        for (int c = 0; c < w; ++c) {
          std::vector<double> v(static_cast<std::size_t>(w), 0);
          v[static_cast<std::size_t>(c)] = 1;
          for (int t = b; t < e; t += x.width) {
            const int end = std::min(t + x.width, e);
            for (int r = t; r < end; ++r) {
              double s = 0;
              for (int k = t; k < end; ++k) s += store_[place(first_[f], x, r, k)] * v[static_cast<std::size_t>(k - b)];
              inverse[static_cast<std::size_t>(c * w + r - b)] = s;
            }
            for (int r = end; r < e; ++r)
              for (int k = t; k < end; ++k)
                v[static_cast<std::size_t>(r - b)] -=
                    store_[place(first_[f], x, r, k)] * inverse[static_cast<std::size_t>(c * w + k - b)];
          }
        }
        for (int c = 0; c < w; ++c)
          for (int r = c / x.width * x.width; r < w; ++r)
            store_[place(first_[f], x, b + r, b + c)] = inverse[static_cast<std::size_t>(c * w + r)];
      }
      x.inverted = kRowBlock;
    }
  }

  // Column k of the inverse.
  [[nodiscard]] std::vector<double> column(Index k) const {
    std::vector<double> x(static_cast<std::size_t>(plan_.tree.n), 0);
    x[static_cast<std::size_t>(k)] = 1;
    reference(x, false);
    return x;
  }

  // Elements of the stack in which the entries of all fronts that are needed came out right.
  Offset check(const std::vector<std::vector<double>>& columns, const std::vector<char>& needed, Offset room,
               bool staged_some) {
    const Kind kind = GetParam().kind;
    std::vector<char> staged_fronts;  // none, or two of three
    for (Index f = 0; staged_some && f < plan_.fronts(); ++f) staged_fronts.push_back(f % 3 != 1 ? 1 : 0);
    const InverseTables t =
        make_inverse_tables(plan_, device_.fronts, {kind, staged_fronts}, needed, room, sizeof(double));
    EXPECT_LE(t.stack, room);
    std::vector<double> stack(static_cast<std::size_t>(t.stack), std::nan(""));
    std::vector<InverseFrontOf<double>> fronts;
    for (const InverseTables::Spot& s : t.spots) {
      const auto to = [&](Offset place) { return stack.data() + place; };
      InverseFrontOf<double> x;
      const bool staged = !staged_fronts.empty() && staged_fronts[static_cast<std::size_t>(s.front)] != 0;
      x.front = device_.fronts[static_cast<std::size_t>(s.front)];
      x.parent = s.parent;
      x.factor = staged ? to(s.factor) : store_.data() + first_[static_cast<std::size_t>(s.front)];
      x.second = staged ? to(s.second) : store_.data() + second_[static_cast<std::size_t>(s.front)];
      x.z = to(s.z), x.across = to(s.across), x.g = to(s.g), x.h = to(s.h), x.m = to(s.m), x.v = to(s.v);
      fronts.push_back(x);
    }
    std::size_t made = 0;
    double most = 0;
    PlainInverse plain(t, kind, fronts, plan_.relative.data(), d_.data(), e_.data());
    plain.run(
        [&](const InverseFrontOf<double>& x, const InverseTables::Spot& s) {
          const auto f = static_cast<std::size_t>(s.front);
          if (staged_fronts[f] == 0) return;
          std::copy_n(store_.data() + first_[f], x.front.factor_size(), const_cast<double*>(x.factor));
          if (kind == Kind::lu)
            std::copy_n(store_.data() + second_[f], x.front.factor_size(), const_cast<double*>(x.second));
        },
        [&](const InverseFrontOf<double>& x, const InverseTables::Spot& s) {
          ++made;
          EXPECT_NE(needed[static_cast<std::size_t>(s.front)], 0);
          for (int c = 0; c < x.front.total_pad; ++c)
            for (int r = 0; r < x.front.total_pad; ++r) {
              const double found = x.z[chunked(x.front.total_pad, r, c)];
              double truth = 0;
              double size = 1;
              if (real(x.front, r) && real(x.front, c)) {
                const auto& column = columns[static_cast<std::size_t>(position(s.front, c))];
                truth = column[static_cast<std::size_t>(position(s.front, r))];
                for (const double v : column) size = std::max(size, std::abs(v));
              }
              const double apart = std::abs(found - truth) / size;
              if (!(apart <= most)) most = apart;
            }
        });
    EXPECT_LE(most, 1e-11);
    for (const char n : needed) made -= n != 0 ? 1 : 0;
    EXPECT_EQ(made, 0U);
    return t.stack;
  }
};

TEST_P(InverseTasks, MakeWhatSubstitutionMakes) {
  std::vector<std::vector<double>> columns;
  for (Index k = 0; k < plan_.tree.n; ++k) columns.push_back(column(k));
  if (GetParam().kind == Kind::llt && GetParam().columns > 1) join();
  const std::vector<char> all(static_cast<std::size_t>(plan_.fronts()), 1);
  constexpr Offset kMuch = Offset{1} << 40;
  const Offset most = check(columns, all, kMuch, false);
  check(columns, all, kMuch, true);
  // What the message asks for is enough, and nothing less is.
  Offset least = 0;
  try {
    make_inverse_tables(plan_, device_.fronts, {GetParam().kind, all}, all, 0, 1);
    ADD_FAILURE() << "no memory at all";
  } catch (const Error& e) {
    EXPECT_EQ(e.status().code, StatusCode::out_of_memory);
  }
  for (Offset low = 0, high = most; low < high;) {  // the least by bisection
    const Offset middle = low + (high - low) / 2;
    try {
      make_inverse_tables(plan_, device_.fronts, {GetParam().kind, {}}, all, middle, 1);
      high = least = middle;
    } catch (const Error&) {
      low = middle + 1;
    }
  }
  EXPECT_LT(least, most);
  check(columns, all, least, false);
  check(columns, all, (least + most) / 2, false);
  // One front, and the way to it.
  std::vector<char> one(all.size(), 0);
  for (Index f = plan_.fronts() / 3; f >= 0; f = plan_.tree.parent[static_cast<std::size_t>(f)])
    one[static_cast<std::size_t>(f)] = 1;
  EXPECT_LE(check(columns, one, least, false), least);
}

INSTANTIATE_TEST_SUITE_P(Systems, InverseTasks,
                         ::testing::Values(Parameter{{"elasticity", "6"}, Kind::llt, 1},
                                           Parameter{{"elasticity", "6"}, Kind::llt, 2},
                                           Parameter{{"elasticity", "5"}, Kind::ldlt, 1},
                                           Parameter{{"gyroscopic", "5"}, Kind::lu, 1},
                                           Parameter{{"plate", "12", "12"}, Kind::ldlt, 1}));

}  // namespace inverse_tables_test
}  // namespace espalier
