// Values and vectors of ranks in the memory of their devices, here emulated ones. The truth is one process with arrays
// of the host: the same bits.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <mutex>
#include <string>
#include <vector>

#include "emulated_gpu.hpp"
#include "espalier/espalier.hpp"
#include "matrix/generators/generate.hpp"
#include "on_threads.hpp"
#include "reference/reference.hpp"
#include "solver/ranks/part_calls.hpp"
#include "solver/session/session_calls.hpp"
#include "solver/solution/solution.hpp"

namespace espalier::ranks {
namespace device_parts_test {

constexpr Index kColumns = 2;

Options on_emulated(const char* device) {
  Options o;
  o.device = device;
  o.threads = 1;
  return o;
}

// Solver's calls, of one rank, with a registry of its own.
class Caller {
 public:
  explicit Caller(const Ranks& ranks = {})
      : session_(ranks, on_emulated(ranks.size() > 1 ? "emulated:all" : "emulated:0"), registry_) {}

  Status analyze(const SparseMatrix& a) {
    return solver::analysis_by(session_, [&] { session_.analyze_given(a.view()); }).status;
  }
  Status analyze(const LocalRows& part) {
    return solver::analysis_by(session_, [&] { session_.analyze_part(solver::GivenLocal<LocalRows>(part)); }).status;
  }
  Status refactorize_device(const double* values, Offset count, void* queue = nullptr) {
    return solver::refactorize_part_device(session_, values, count, queue).status;
  }
  Status solve_device(const double* b, double* x, void* queue = nullptr) {
    return solver::solve_part_device(
               session_, b, x, kColumns, queue,
               [&](double* all) {
                 return solver::solve(*session_.factor, {all, all, kColumns, false}, session_.context);
               })
        .status;
  }
  solver::Session& session() { return session_; }
  [[nodiscard]] const EmulatedWork& work() const { return gpu_.work; }

 private:
  EmulatedGpu gpu_;
  const device::Registry registry_{{&device::registry().host(), &gpu_}, {}};
  solver::Session session_;
};

// What one process has with arrays of the host.
std::vector<double> truth_of(const SparseMatrix& a, const std::vector<double>& b) {
  Caller alone;
  EXPECT_TRUE(alone.analyze(a).ok());
  solver::Session& s = alone.session();
  EXPECT_TRUE(solver::factor_by(s, [&](solver::Factor& f) { f.factorize(a.values); }).status.ok());
  std::vector<double> x(b.size());
  EXPECT_TRUE(solver::solve_by(s, [&] {
                return solver::solve(*s.factor, {b.data(), x.data(), kColumns, false}, s.context);
              }).status.ok());
  EXPECT_GT(alone.work().sent, 0) << "the linear system is not there: nothing is tested";
  return x;
}

// Rows of a symmetric matrix, of which the lower triangle is stored: the columns are those of the upper one.
struct Rows {
  Rows(const SparseMatrix& a, Index begin, Index end) : first(begin), n(a.rows) {
    const Offset at = a.col_ptr[static_cast<std::size_t>(begin)];
    for (Index r = begin; r <= end; ++r) ptr.push_back(a.col_ptr[static_cast<std::size_t>(r)] - at);
    col.assign(a.row_ind.begin() + at, a.row_ind.begin() + at + ptr.back());
    values.assign(a.values.begin() + at, a.values.begin() + at + ptr.back());
  }
  [[nodiscard]] LocalRows view() const { return {n, first, ptr, col, values, Storage::symmetric_upper}; }
  [[nodiscard]] Offset entries() const { return ptr.back(); }
  // These rows of each column.
  [[nodiscard]] std::vector<double> of(const std::vector<double>& v) const {
    std::vector<double> piece;
    const auto count = static_cast<Offset>(ptr.size()) - 1;
    for (Index c = 0; c < kColumns; ++c)
      piece.insert(piece.end(), v.begin() + Offset{c} * n + first, v.begin() + Offset{c} * n + first + count);
    return piece;
  }

  Index first, n;
  std::vector<Offset> ptr;
  std::vector<Index> col;
  std::vector<double> values;
};

SparseMatrix elasticity() {
  return matrix::generate(matrix::parse_generator(std::vector<std::string>{"elasticity", "5", "4", "3"}));
}

TEST(DeviceParts, ByRows) {
  const SparseMatrix a = elasticity();
  const std::vector<double> b = reference::random_vector(Offset{a.rows} * kColumns, 9);
  const std::vector<double> truth = truth_of(a, b);
  const std::vector<Index> begin{0, 7, 7, a.rows};  // rank 1 has none
  on_threads(3, {}, [&](const Ranks& ranks) {
    const auto r = static_cast<std::size_t>(ranks.rank());
    const Rows rows(a, begin[r], begin[r + 1]);
    Caller caller(ranks);
    ASSERT_TRUE(caller.analyze(rows.view()).ok());
    int queue = 0;
    for (int again = 0; again < 2; ++again) {
      const Status factor = caller.refactorize_device(rows.values.data(), rows.entries(), &queue);
      ASSERT_TRUE(factor.ok()) << factor.message;
    }
    EXPECT_EQ(caller.work().waited_for, rows.entries() > 0 ? &queue : nullptr);
    std::vector<double> x = rows.of(b);
    const Status solve = caller.solve_device(x.data(), x.data());
    EXPECT_TRUE(solve.ok()) << solve.message;
    EXPECT_EQ(x, rows.of(truth));
    EXPECT_EQ(caller.work().copied, 0);
  });
}

// Values of rank 0 go from device to device; its host has none of them, unless they are asked for.
TEST(DeviceParts, AllOnRankZero) {
  const SparseMatrix a = elasticity();
  const std::vector<double> b = reference::random_vector(Offset{a.rows} * kColumns, 9);
  const std::vector<double> truth = truth_of(a, b);
  on_threads(3, {}, [&](const Ranks& ranks) {
    const bool first = ranks.rank() == 0;
    Caller caller(ranks);
    ASSERT_TRUE(caller.analyze(first ? a : SparseMatrix()).ok());
    const Status factor =
        first ? caller.refactorize_device(a.values.data(), a.nonzeros()) : caller.refactorize_device(nullptr, 0);
    ASSERT_TRUE(factor.ok()) << factor.message;
    EXPECT_EQ(caller.work().copied, first ? 1 : 0);
    EXPECT_EQ(caller.work().sent, 0);
    std::vector<double> x(first ? b : std::vector<double>());
    const Status solve = caller.solve_device(x.data(), x.data());
    EXPECT_TRUE(solve.ok()) << solve.message;
    if (first) {
      EXPECT_EQ(x, truth);
    }
    EXPECT_EQ(caller.session().factor->values_by_caller(), a.values) << "the last values, on every rank";
  });
}

// Entries that come twice are summed on the host.
TEST(DeviceParts, AllOnRankZeroWithDuplicates) {
  const SparseMatrix a =
      reference::stored_as(reference::random_system(200, 4, reference::Values::general, 5), Storage::general, true);
  const std::vector<double> b = reference::random_vector(Offset{a.rows} * kColumns, 9);
  const std::vector<double> truth = truth_of(a, b);
  on_threads(2, {}, [&](const Ranks& ranks) {
    const bool first = ranks.rank() == 0;
    Caller caller(ranks);
    ASSERT_TRUE(caller.analyze(first ? a : SparseMatrix()).ok());
    const Status factor =
        first ? caller.refactorize_device(a.values.data(), a.nonzeros()) : caller.refactorize_device(nullptr, 0);
    ASSERT_TRUE(factor.ok()) << factor.message;
    EXPECT_EQ(caller.work().copied, 0);
    std::vector<double> x(first ? b : std::vector<double>());
    EXPECT_TRUE(caller.solve_device(x.data(), x.data()).ok());
    if (first) {
      EXPECT_EQ(x, truth);
    }
  });
}

// Said on all ranks in the same words, which name the entry; the next values are taken.
TEST(DeviceParts, ValuesThatAreNotFinite) {
  const SparseMatrix a = elasticity();
  const Index n = a.rows;
  for (const bool in_parts : {true, false}) {
    std::vector<Status> ends(2);
    on_threads(2, {}, [&](const Ranks& ranks) {
      Rows rows(a, ranks.rank() == 0 ? 0 : n / 2, ranks.rank() == 0 ? n / 2 : n);
      if (!in_parts) rows = Rows(a, 0, ranks.rank() == 0 ? n : 0);
      Caller caller(ranks);
      ASSERT_TRUE((in_parts ? caller.analyze(rows.view()) : caller.analyze(a)).ok());
      std::vector<double> bad = rows.values;
      if (ranks.rank() == (in_parts ? 1 : 0)) bad.back() = std::nan("");
      ends[static_cast<std::size_t>(ranks.rank())] = caller.refactorize_device(bad.data(), rows.entries());
      const Status again = caller.refactorize_device(rows.values.data(), rows.entries());
      EXPECT_TRUE(again.ok()) << again.message;
    });
    EXPECT_EQ(ends[0].code, StatusCode::invalid_input);
    EXPECT_EQ(ends[0].message, ends[1].message);
    EXPECT_NE(ends[0].message.find("is nan"), std::string::npos) << ends[0].message;
  }
}

// A wrong argument of one rank is its own mistake, and ends the call of the others.
TEST(DeviceParts, WrongArraysOfOneRank) {
  const SparseMatrix a = elasticity();
  const Index n = a.rows;
  on_threads(2, {}, [&](const Ranks& ranks) {
    const bool wrong = ranks.rank() == 1;
    const Rows rows(a, wrong ? n / 2 : 0, wrong ? n : n / 2);
    Caller caller(ranks);
    ASSERT_TRUE(caller.analyze(rows.view()).ok());
    const Status status = caller.refactorize_device(rows.values.data(), rows.entries() - (wrong ? 1 : 0));
    EXPECT_EQ(status.code, StatusCode::invalid_input);
    EXPECT_NE(status.message.find("entries of this rank's part"), std::string::npos) << status.message;
    const auto expect_misuse = [&](const auto& call) {
      if (wrong) {
        EXPECT_THROW((void)call(), std::invalid_argument);
      } else {
        const Status end = call();
        EXPECT_EQ(end.code, StatusCode::invalid_input);
        EXPECT_NE(end.message.find("not in the memory of a GPU"), std::string::npos) << end.message;
      }
    };
    expect_misuse([&] { return caller.refactorize_device(wrong ? nullptr : rows.values.data(), rows.entries()); });
    ASSERT_TRUE(caller.refactorize_device(rows.values.data(), rows.entries()).ok());
    std::vector<double> x(rows.of(std::vector<double>(static_cast<std::size_t>(n * kColumns), 1.0)));
    expect_misuse([&] { return caller.solve_device(x.data(), wrong ? nullptr : x.data()); });
    EXPECT_TRUE(caller.solve_device(x.data(), x.data()).ok());
  });
}

// On hosts there is no such memory.
TEST(DeviceParts, RanksOfHostsRefuseThem) {
  const SparseMatrix a = elasticity();
  on_threads(2, {}, [&](const Ranks& ranks) {
    Options options;
    options.device = "cpu";
    options.threads = 1;
    Solver solver(ranks, options);
    ASSERT_TRUE(solver.analyze(a).status.ok());
    const Status factor = solver.refactorize_device(a.values.data(), a.nonzeros()).status;
    EXPECT_EQ(factor.code, StatusCode::device_error);
    EXPECT_NE(factor.message.find("use refactorize()"), std::string::npos) << factor.message;
    ASSERT_TRUE(solver.refactorize(a.values).status.ok());
    std::vector<double> x(static_cast<std::size_t>(a.rows), 1.0);
    const Status solve = solver.solve_device(x.data(), x.data()).status;
    EXPECT_EQ(solve.code, StatusCode::device_error);
    EXPECT_NE(solve.message.find("use solve()"), std::string::npos) << solve.message;
    EXPECT_TRUE(solver.solve(x, x).status.ok());
  });
}

}  // namespace device_parts_test
}  // namespace espalier::ranks
