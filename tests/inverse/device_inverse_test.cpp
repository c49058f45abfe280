// Entries of the inverse on every device that is here: GPUs, small memories. Truth: dense inverses by Eigen, and
// columns that a solver on the host refines.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstring>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "base/at.hpp"
#include "device/backends.hpp"
#include "espalier/inverse.hpp"
#include "matrix/generators/generate.hpp"
#include "reference/reference.hpp"
#include "solver/complex_common.hpp"
#include "solver/gpu/refused_calls.hpp"

namespace espalier::test {

namespace {

bool has_gpu() {
  for (const device::Backend* b : backends_here())
    if (b->name() == "gpu") return true;
  return false;
}

std::vector<std::string> devices_here() {
  std::vector<std::string> list = {"cpu"};
  if (has_gpu()) list.push_back("gpu:0");
  return list;
}

/// Entries beside columns of a solver on the host; of those beyond `limit` the first one is told.
void expect_columns(const SparseMatrix& a, const std::vector<double>& x, Index count, double limit) {
  Options o;
  o.device = "cpu";
  Solver s(o);
  ASSERT_TRUE(s.analyze(a).status.ok());
  ASSERT_TRUE(s.factorize(a).status.ok());
  count = std::min(count, a.cols);
  std::vector<double> b(at(a.cols) * at(count), 0), columns(b.size());
  const auto column = [&](Index c) { return static_cast<Index>(Offset{c} * a.cols / count); };
  for (Index c = 0; c < count; ++c) b[at(c) * at(a.cols) + at(column(c))] = 1;
  ASSERT_TRUE(s.solve(b, columns, count).status.ok());
  double most = 0;
  std::string first;
  Offset wrong = 0, all = 0;
  for (Index c = 0; c < count; ++c) {
    const double* truth = columns.data() + at(c) * at(a.cols);
    double largest = 0;
    for (Index i = 0; i < a.cols; ++i) largest = std::max(largest, std::abs(truth[i]));
    for (Offset q = a.col_ptr[at(column(c))]; q < a.col_ptr[at(column(c)) + 1]; ++q, ++all) {
      const double apart = std::abs(x[at(q)] - truth[a.row_ind[at(q)]]) / largest;
      most = std::isnan(apart) ? apart : std::max(most, apart);
      if (apart <= limit) continue;
      ++wrong;
      if (first.empty())
        first = "entry (" + std::to_string(a.row_ind[at(q)]) + ", " + std::to_string(column(c)) + ") is " +
                std::to_string(x[at(q)]) + ", not " + std::to_string(truth[a.row_ind[at(q)]]);
    }
  }
  EXPECT_EQ(wrong, 0) << "of " << all << ": " << first << "; the largest error is " << most;
}

SparseMatrix random_of(int sort, Index n, std::uint64_t seed) {
  if (sort == 3) return reference::saddle_point(n, std::max<Index>(1, n / 4), seed);
  const reference::Values values[] = {reference::Values::positive, reference::Values::indefinite,
                                      reference::Values::general};
  return reference::random_system(n, 3, values[sort], seed);
}

}  // namespace

TEST(DeviceInverse, RandomSystemsAgreeWithDenseInverses) {
  for (const std::string& device : devices_here()) {
    std::mt19937_64 random(5);
    int compared = 0;
    for (int run = 0; run < 120; ++run) {
      const int sort = run % 4;
      const auto n = static_cast<Index>(run < 8 ? 3 + run : 1 + random() % (run % 10 == 0 ? 400 : 120));
      if (n < 3) continue;
      const SparseMatrix a = random_of(sort, n, random());
      const double condition = reference::condition(a);
      if (!(condition < 1e9)) continue;
      Options o;
      o.device = device;
      o.threads = 1 + run % 2;
      o.max_block_size = run % 3 == 0 ? 32 : 0;
      if (run % 5 == 0) o.kind = Kind::lu;
      Solver s(o);
      SCOPED_TRACE(device + ", run " + std::to_string(run) + ", n " + std::to_string(a.cols));
      ASSERT_TRUE(s.analyze(a).status.ok());
      ASSERT_TRUE(s.factorize(a).status.ok());
      std::vector<double> x(at(a.nonzeros()));
      const InverseResult r = selected_inverse(s, a, x, Transpose::yes);
      ASSERT_TRUE(r.status.ok()) << r.status.message;
      EXPECT_EQ(r.solved, 0);
      std::vector<double> identity(at(a.cols) * at(a.cols), 0);
      for (Index i = 0; i < a.cols; ++i) identity[at(i) * at(a.cols) + at(i)] = 1;
      const std::vector<double> dense = reference::solve(a, identity, a.cols, false);
      const double limit = 100 * condition * std::numeric_limits<double>::epsilon();
      for (Index j = 0; j < a.cols; ++j)
        for (Offset q = a.col_ptr[at(j)]; q < a.col_ptr[at(j) + 1]; ++q) {
          const double* column = dense.data() + at(a.row_ind[at(q)]) * at(a.cols);
          double largest = 0;
          for (Index i = 0; i < a.cols; ++i) largest = std::max(largest, std::abs(column[i]));
          ASSERT_NEAR(x[at(q)], column[j], limit * largest) << "entry " << q << ", sort " << sort;
        }
      EXPECT_LE(r.error, limit);
      ++compared;
    }
    EXPECT_GT(compared, 60) << device;
  }
}

// Fronts of every form, tile and block; all kinds.
TEST(DeviceInverse, LargeFronts) {
  for (const std::string& device : devices_here())
    for (const Kind kind : {Kind::llt, Kind::ldlt, Kind::lu})
      for (const char* size : {"2", "5", "12"}) {
        SCOPED_TRACE(device + ", kind " + std::to_string(static_cast<int>(kind)) + ", elasticity " + size);
        const SparseMatrix a = matrix::generate(matrix::parse_generator(std::vector<std::string>{"elasticity", size}));
        Options o;
        o.device = device;
        o.kind = kind;
        Solver s(o);
        ASSERT_TRUE(s.analyze(a).status.ok());
        ASSERT_TRUE(s.factorize(a).status.ok());
        std::vector<double> x(at(a.nonzeros())), again(x), diagonal(at(a.cols));
        const InverseResult r = selected_inverse(s, a, x);
        EXPECT_TRUE(r.status.ok()) << r.status.message;
        EXPECT_LE(r.error, 1e-11);
        expect_columns(a, x, 50, 1e-10);
        ASSERT_TRUE(inverse_diagonal(s, diagonal).status.ok());
        for (Index j = 0; j < a.cols; ++j)
          for (Offset q = a.col_ptr[at(j)]; q < a.col_ptr[at(j) + 1]; ++q)
            if (a.row_ind[at(q)] == j) {
              ASSERT_EQ(diagonal[at(j)], x[at(q)]) << "other entries change no bits";
            }
        ASSERT_TRUE(s.factorize(a).status.ok());
        ASSERT_TRUE(selected_inverse(s, a, again).status.ok());
        EXPECT_EQ(std::memcmp(x.data(), again.data(), x.size() * sizeof(double)), 0) << "the same bits again";
      }
}

TEST(DeviceInverse, OfIndefiniteAndUnsymmetricSystems) {
  for (const std::string& device : devices_here())
    for (const auto& words : std::vector<std::vector<std::string>>{
             {"kkt", "3", "8", "4", "4"}, {"gyroscopic", "7"}, {"plate", "40", "40"}}) {
      SCOPED_TRACE(device + ", " + words[0]);
      const SparseMatrix a = matrix::generate(matrix::parse_generator(words));
      Options o;
      o.device = device;
      Solver s(o);
      ASSERT_TRUE(s.analyze(a).status.ok());
      ASSERT_TRUE(s.factorize(a).status.ok());
      std::vector<double> x(at(a.nonzeros()));
      const InverseResult r = selected_inverse(s, a, x);
      EXPECT_TRUE(r.status.ok()) << r.status.message;
      EXPECT_LE(r.error, 1e-9);
      expect_columns(a, x, 50, 1e-8);
    }
}

TEST(DeviceInverse, ComplexSystems) {
  for (const std::string& device : devices_here())
    for (int run = 0; run < 24; ++run) {
      const Sort sort = static_cast<Sort>(run % 4);
      const Index n = 5 + run * 9;
      SCOPED_TRACE(device + ", run " + std::to_string(run));
      const Dense a = random_dense(n, sort, static_cast<unsigned>(run)), inverse = a.inverse();
      const Storage storage = sort == Sort::general     ? Storage::general
                              : sort == Sort::symmetric ? Storage::symmetric_lower
                                                        : Storage::hermitian_lower;
      const double condition = a.cwiseAbs().colwise().sum().maxCoeff() * inverse.cwiseAbs().colwise().sum().maxCoeff();
      if (!(condition < 1e8)) continue;
      Options o;
      o.device = device;
      ComplexSolver s(o);
      const ComplexSparseMatrix m = sparse(a, storage);
      ASSERT_TRUE(s.analyze(m).status.ok());
      ASSERT_TRUE(s.factorize(m).status.ok());
      std::vector<Value> x(m.values.size());
      const InverseResult r = selected_inverse(s, m, x, Transpose::yes);
      ASSERT_TRUE(r.status.ok()) << r.status.message;
      const Dense truth = op(inverse, Transpose::yes);
      // Pivots that are chosen inside of tiles may cost digits, which the estimate tells.
      const double largest = inverse.cwiseAbs().maxCoeff();
      const double told = std::max(20 * n * condition * kEps, 10 * r.error) * largest;
      EXPECT_LE(r.error, 1e-6);
      for (Index j = 0; j < n; ++j)
        for (auto q = at(m.col_ptr[at(j)]); q < at(m.col_ptr[at(j) + 1]); ++q)
          ASSERT_LE(std::abs(x[q] - truth(m.row_ind[q], j)), told) << m.row_ind[q] << ", " << j;
    }
}

// The estimate is no less than a tenth of the largest true error, however ill-conditioned the matrix is. Truth:
// inverses in long double.
TEST(DeviceInverse, EstimatesAreHonest) {
  using Long = Eigen::Matrix<long double, Eigen::Dynamic, Eigen::Dynamic>;
  double worst = 0;
  int judged = 0;
  for (const std::string& device : devices_here())
    for (int run = 0; run < 36; ++run) {
      const Index n = 60 + 5 * run;
      std::mt19937_64 random(static_cast<unsigned>(run));
      std::uniform_real_distribution<double> uniform(-1, 1);
      std::vector<reference::Triple> list;
      const auto add = [&](Index i, Index j, double v) {
        if (i >= 0 && j >= 0 && i < n && j < n) list.push_back({i, j, v});
      };
      for (Index j = 0; j < n; ++j) {
        const double scale = std::pow(10.0, run % 3 * uniform(random));
        if (run % 4 == 0) {  // a beam: fourth differences, condition n^4
          for (const auto& [d, v] : {std::pair{0, 6.0}, {1, -4.0}, {2, 1.0}}) add(j + d, j, v);
        } else if (run % 4 == 1) {  // a chain with soft springs
          add(j, j, 2 + 1e-9 * scale);
          add(j + 1, j, -1);
        } else if (run % 4 == 2) {  // indefinite, near an eigenvalue
          add(j, j, 2 - 2 * std::cos(3.14159265358979 * 7 / (n + 1.0)) * (1 + 1e-8));
          add(j + 1, j, -1);
        } else {  // a chain whose springs differ by ten decades
          const double next = std::pow(10.0, 5 * std::sin(0.7 * j + 0.7)), here = std::pow(10.0, 5 * std::sin(0.7 * j));
          add(j, j, here + next);
          add(j + 1, j, -next);
        }
      }
      std::sort(list.begin(), list.end(),
                [](const auto& a, const auto& b) { return a.col != b.col ? a.col < b.col : a.row < b.row; });
      const SparseMatrix a = reference::from_triples(n, list, Storage::symmetric_lower);
      Long dense = Long::Zero(n, n);
      for (const auto& t : list) dense(t.row, t.col) = dense(t.col, t.row) = t.value;
      const Long truth = dense.fullPivLu().inverse();
      Options o;
      o.device = device;
      if (run % 5 == 0) o.kind = Kind::lu;
      if (run % 7 == 0) o.precision = Precision::fp32;
      Solver s(o);
      SCOPED_TRACE(device + ", run " + std::to_string(run));
      ASSERT_TRUE(s.analyze(a).status.ok());
      if (!s.factorize(a).status.ok()) continue;  // singular in its precision
      std::vector<double> x(at(a.nonzeros()));
      const InverseResult r = selected_inverse(s, a, x);
      ASSERT_TRUE(r.status.ok() || r.status.code == StatusCode::accuracy_not_reached) << r.status.message;
      double error = 0;
      for (Index j = 0; j < n; ++j)
        for (Offset q = a.col_ptr[at(j)]; q < a.col_ptr[at(j) + 1]; ++q) {
          const long double largest = truth.row(a.row_ind[at(q)]).cwiseAbs().maxCoeff();
          error = std::max(error, static_cast<double>(std::abs(x[at(q)] - truth(a.row_ind[at(q)], j)) / largest));
        }
      EXPECT_GE(r.error, error / 10);
      if (error > 1e-14) worst = std::max(worst, error / r.error);
      ++judged;
    }
  EXPECT_GT(judged, 20);
  RecordProperty("largest_error_over_estimate", std::to_string(worst));
}

// Factors that go through a memory of half of what they take, and of less: right entries, or a clear refusal.
TEST(DeviceInverse, SmallMemories) {
  for (const std::string& device : devices_here())
    for (const Kind kind : {Kind::llt, Kind::ldlt, Kind::lu}) {
      const SparseMatrix a = matrix::generate(matrix::parse_generator(std::vector<std::string>{"elasticity", "11"}));
      Options o;
      o.device = device == "cpu" ? "host:1" : device;
      o.kind = kind;
      Solver whole(o);
      ASSERT_TRUE(whole.analyze(a).status.ok());
      const Offset all = whole.factorize(a).devices.front().peak_bytes;
      for (const int part : {2, 3, 5}) {
        SCOPED_TRACE(o.device + ", kind " + std::to_string(static_cast<int>(kind)) + ", a part of " +
                     std::to_string(part));
        o.device_memory_bytes = all / part;
        Solver s(o);
        if (!s.analyze(a).status.ok()) continue;
        const FactorResult f = s.factorize(a);
        if (part > 2 && !f.status.ok()) continue;
        ASSERT_TRUE(f.status.ok()) << f.status.message;
        std::vector<double> b(at(a.cols), 1), before(b), after(b), x(at(a.nonzeros()));
        ASSERT_TRUE(s.solve(b, before).status.ok());
        const InverseResult r = selected_inverse(s, a, x);
        // A GPU has the factor and the inverse of the largest front at once, beside what stays of the factor.
        if ((part > 2 || device != "cpu") && r.status.code == StatusCode::out_of_memory) {
          EXPECT_NE(r.status.message.find("device"), std::string::npos) << r.status.message;
          continue;
        }
        ASSERT_TRUE(r.status.ok()) << r.status.message;
        EXPECT_LE(r.error, 1e-11);
        expect_columns(a, x, 50, 1e-10);
        ASSERT_TRUE(s.solve(b, after).status.ok());
        EXPECT_EQ(std::memcmp(before.data(), after.data(), b.size() * sizeof(double)), 0) << "the factor is as it was";
      }
    }
}

TEST(DeviceInverse, SinglePrecisionTellsItsError) {
  for (const std::string& device : devices_here()) {
    SCOPED_TRACE(device);
    const SparseMatrix a =
        matrix::generate(matrix::parse_generator(std::vector<std::string>{"poisson", "12", "12", "12"}));
    Options o;
    o.device = device;
    o.precision = Precision::fp32;
    Solver s(o);
    ASSERT_TRUE(s.analyze(a).status.ok());
    ASSERT_TRUE(s.factorize(a).status.ok());
    std::vector<double> x(at(a.nonzeros()));
    const InverseResult r = selected_inverse(s, a, x);
    ASSERT_TRUE(r.status.ok()) << r.status.message;
    EXPECT_GT(r.error, 1e-9);
    EXPECT_LE(r.error, 1e-5);
    expect_columns(a, x, 50, 10 * r.error);
  }
}

using InverseFaults = RefusedCalls;

// Calls of CUDA refused in turn. Truth: entries of the inverse on the host.
TEST_F(InverseFaults, RefusedCallsAreNamedAndTheEntriesAreRightAfterwards) {
  for (const Kind kind : {Kind::ldlt, Kind::lu}) {
    const SparseMatrix a = matrix::generate(matrix::parse_generator(std::vector<std::string>{"elasticity", "6"}));
    Options o;
    o.kind = kind;
    o.threads = 2;
    o.device = "cpu";
    std::vector<double> truth(at(a.nonzeros()));
    Solver host(o);
    ASSERT_TRUE(host.analyze(a).status.ok());
    ASSERT_TRUE(host.factorize(a).status.ok());
    ASSERT_TRUE(selected_inverse(host, a, truth).status.ok());
    double largest = 0;
    for (const double v : truth) largest = std::max(largest, std::abs(v));
    o.device = "gpu:0";
    o.pinned_memory_bytes = 0;
    struct Case {
      Solver s;
      std::vector<double> x;
    };
    const Refusals told = refuse_some(
        [&]() -> Attempt {
          auto c = std::make_shared<Case>(Case{Solver(o), std::vector<double>(truth.size())});
          EXPECT_TRUE(c->s.analyze(a).status.ok());
          EXPECT_TRUE(c->s.factorize(a).status.ok());
          return {[&, c] {  // a call that failed may have taken the factor with it
                    if (c->s.state() != Solver::State::factorized)
                      if (const FactorResult f = c->s.factorize(a); !f.status.ok()) return f.status;
                    return selected_inverse(c->s, a, c->x).status;
                  },
                  [&, c] {
                    for (std::size_t q = 0; q < truth.size(); ++q)
                      ASSERT_NEAR(c->x[q], truth[q], 1e-10 * largest) << "entry " << q;
                  }};
        },
        60);
    EXPECT_GT(told.errors, told.tried / 3);
  }
}

}  // namespace espalier::test
