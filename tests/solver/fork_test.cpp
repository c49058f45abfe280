// Solvers of the parent in the child of a fork(), as Python's multiprocessing makes them. Truth: the backward error,
// and the bits of the parent's solution.
#include <gtest/gtest.h>

#include <atomic>
#include <string>
#include <thread>

#include "espalier/espalier.h"
#include "process.hpp"
#include "solver/solver_common.hpp"

namespace espalier {
namespace fork_test {

using namespace test;

struct System {
  SparseMatrix a = generated({"elasticity", "8"});
  std::vector<double> b = reference::random_vector(a.rows, 1);
  std::vector<double> x = std::vector<double>(b.size());
};

TEST(Fork, TheChildSolvesOnTheParentsFactor) {
  for (const char* device : {"cpu", "host:2"}) {
    System s;
    Options o = two_threads();
    o.device = device;
    Solver solver(o);
    ASSERT_TRUE(solver.analyze(s.a).status.ok());
    ASSERT_TRUE(solver.factorize(s.a).status.ok());
    ASSERT_TRUE(solver.solve(s.b, s.x).status.ok());
    EXPECT_EQ(in_child([&] {
                std::vector<double> x(s.x.size());
                const bool solved = solver.solve(s.b, x).status.ok() && x == s.x;
                const bool again = solver.refactorize(s.a.values).status.ok() && solver.solve(s.b, x).status.ok();
                const bool anew = solver.analyze(s.a).status.ok() && solver.factorize(s.a).status.ok();
                return solved && again && anew && reference::backward_error(s.a, s.b, x) <= 8 * kEps;
              }),
              0)
        << device;
    EXPECT_TRUE(solver.solve(s.b, s.x).status.ok()) << "the parent goes on";
  }
}

TEST(Fork, AFactorOutOfCore) {
  System s;
  Options o = two_threads();
  o.device = "host:1";
  Solver whole(o);
  ASSERT_TRUE(whole.analyze(s.a).status.ok());
  o.device_memory_bytes = whole.factorize(s.a).devices.front().peak_bytes / 2;
  Solver solver(o);
  ASSERT_TRUE(solver.analyze(s.a).status.ok());
  const FactorResult f = solver.factorize(s.a);
  ASSERT_TRUE(f.status.ok()) << f.status.message;
  ASSERT_GT(f.devices.front().streamed_in_bytes + f.devices.front().streamed_out_bytes, 0);
  ASSERT_TRUE(solver.solve(s.b, s.x).status.ok());
  EXPECT_EQ(in_child([&] {
              std::vector<double> x(s.x.size());
              return solver.refactorize(s.a.values).status.ok() && solver.solve(s.b, x).status.ok() && x == s.x;
            }),
            0);
}

// The C interface with one solver on each of two threads: one forks while the other one is inside a call.
TEST(Fork, ASolverInsideACallSaysSo) {
  System s;
  std::vector<std::int64_t> pointers(s.a.col_ptr.begin(), s.a.col_ptr.end()),
      rows(s.a.row_ind.begin(), s.a.row_ind.end());
  espalier_matrix_i64 a{};
  a.size = sizeof a;
  a.rows = a.cols = s.a.rows;
  a.nonzeros = s.a.nonzeros();
  a.pointers = pointers.data();
  a.indices = rows.data();
  a.values = s.a.values.data();
  a.storage = ESPALIER_SYMMETRIC_LOWER;
  espalier_solver *mine = nullptr, *other = nullptr;
  for (espalier_solver** h : {&mine, &other}) {
    ASSERT_EQ(espalier_create(h), ESPALIER_OK);
    ASSERT_EQ(espalier_set_option(*h, "threads", "2"), ESPALIER_OK);
    ASSERT_EQ(espalier_set_option(*h, "device", "cpu"), ESPALIER_OK);
    ASSERT_EQ(espalier_analyze_i64(*h, &a, nullptr), ESPALIER_OK) << espalier_last_error(*h);
    ASSERT_EQ(espalier_factorize_i64(*h, &a, nullptr), ESPALIER_OK);
  }
  std::atomic<bool> stop{false};
  std::thread busy([&] {
    std::vector<double> x(s.x.size());
    while (!stop) EXPECT_EQ(espalier_solve(other, s.b.data(), x.data(), 1, 0, nullptr), ESPALIER_OK);
  });
  int inside = 0;
  for (int round = 0; round < 30 && (round < 3 || inside == 0); ++round) {
    const int code = in_child([&] {
      std::vector<double> x(s.x.size()), y(s.x.size());
      const bool solved = espalier_solve(mine, s.b.data(), x.data(), 1, 0, nullptr) == ESPALIER_OK &&
                          reference::backward_error(s.a, s.b, x) <= 8 * kEps;
      if (!solved) return false;
      const int status = espalier_solve(other, s.b.data(), y.data(), 1, 0, nullptr);
      const bool turned_away =
          status == ESPALIER_MISUSE && std::string(espalier_last_error(other)).find("forked") != std::string::npos;
      espalier_destroy(other);
      if (turned_away) ::_exit(10);
      return status == ESPALIER_OK && x == y;
    });
    EXPECT_TRUE(code == 0 || code == 10) << "round " << round << ": " << code;
    inside += code == 10 ? 1 : 0;
  }
  EXPECT_GT(inside, 0) << "no fork met the other thread inside a call";
  stop = true;
  busy.join();
  espalier_destroy(mine);
  espalier_destroy(other);
}

}  // namespace fork_test
}  // namespace espalier
