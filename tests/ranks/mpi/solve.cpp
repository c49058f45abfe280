// For mpirun: the same bits on all ranks together as in each process alone. Compiled by tests/ranks/mpi/run.py against
// the mpi.h of each MPI that is there.
//   solve [stop RANK AT]    RANK stops (dies, with AT = 0) after so many systems
//   solve gpu:all           each rank on a GPU; alone on the first that it sees
#include <espalier/mpi.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <espalier/espalier.hpp>
#include <string>
#include <vector>

#include "matrix/generators/generate.hpp"

namespace {

using espalier::Index;
using espalier::Offset;

struct Rows {
  std::vector<Offset> ptr{0};
  std::vector<Index> col;
  std::vector<double> values;
};

Rows rows_of(const espalier::SparseMatrix& a, Index first, Index end) {
  std::vector<std::vector<std::pair<Index, double>>> rows(static_cast<std::size_t>(end - first));
  for (Index c = 0; c < a.cols; ++c)
    for (Offset k = a.col_ptr[c]; k < a.col_ptr[c + 1]; ++k)
      if (a.row_ind[k] >= first && a.row_ind[k] < end) rows[a.row_ind[k] - first].emplace_back(c, a.values[k]);
  Rows r;
  for (const auto& row : rows) {
    for (const auto& [c, v] : row) {
      r.col.push_back(c);
      r.values.push_back(v);
    }
    r.ptr.push_back(static_cast<Offset>(r.col.size()));
  }
  return r;
}

int failures = 0;

void expect(bool good, const std::string& what) {
  if (good) return;
  ++failures;
  std::fprintf(stderr, "FAILED: %s\n", what.c_str());
}

std::string device = "cpu";

void check(const espalier::Ranks& ranks, const std::vector<std::string>& words, bool one_has_none) {
  const espalier::SparseMatrix a = espalier::matrix::generate(espalier::matrix::parse_generator(words));
  const Index n = a.rows, parts = one_has_none ? ranks.size() - 1 : ranks.size(), me = ranks.rank();
  const auto border = [&](Index r) { return static_cast<Index>(Offset{n} * std::min(r, parts) / parts); };
  const Index first = border(me), count = border(me + 1) - first;
  espalier::Options options;
  options.threads = 1;
  options.device = device == "cpu" ? device : "gpu:0";
  std::vector<double> b(static_cast<std::size_t>(n)), truth(b.size());
  for (Index i = 0; i < n; ++i) b[i] = 1.0 / (1 + i % 17) - 0.3;
  espalier::Solver alone(options);
  expect(alone.analyze(a).status.ok() && alone.factorize(a).status.ok() && alone.solve(b, truth).status.ok(), "alone");

  options.device = device;
  espalier::Solver solver(ranks, options);
  const Rows part = rows_of(a, first, first + count);
  const auto analysis = solver.analyze(espalier::LocalRows{n, first, part.ptr, part.col, part.values, a.storage});
  expect(analysis.status.ok(), analysis.status.message);
  const auto factor = solver.refactorize(part.values);
  expect(factor.status.ok(), factor.status.message);
  std::vector<double> x(b.begin() + first, b.begin() + first + count);
  for (int k = 0; k < 3; ++k) {  // again, with what the run before has left
    const auto again = solver.refactorize(part.values);
    expect(again.status.ok(), again.status.message);
  }
  const auto solved = solver.solve(x, x);
  expect(solved.status.ok(), solved.status.message);
  expect(count == 0 || std::memcmp(x.data(), truth.data() + first, x.size() * sizeof(double)) == 0,
         words[0] + ": other bits");
}

}  // namespace

int main(int argc, char** argv) {
  MPI_Init(&argc, &argv);
  int rank = 0;
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  if (argc == 2) device = argv[1];
  const int stopped = argc > 3 ? std::atoi(argv[2]) : -1;
  const bool dies = argc > 3 && std::string(argv[1]) == "die";
  {
    const espalier::Ranks ranks = espalier::on(MPI_COMM_WORLD, stopped >= 0 ? 2 : 60);
    if (stopped >= 0) {
      if (rank == stopped && dies) ::raise(SIGKILL);
      if (rank == stopped) ::sleep(6);
      espalier::Solver solver(ranks);
      const auto status = solver.analyze(espalier::MatrixView{}).status;
      std::printf("rank %d: %d %s\n", rank, static_cast<int>(status.code), status.message.c_str());
      std::fflush(stdout);
      ::sleep(4);  // MPICH ends all when one ends so, and the others may not have said it yet
      ::_exit(status.code == espalier::StatusCode::device_error ? 0 : 1);
    }
    check(ranks, {"elasticity", "7", "5", "4"}, false);
    check(ranks, {"kkt", "3", "4", "2", "2"}, ranks.size() > 1);
    check(ranks, {"gyroscopic", "5", "4", "4"}, false);
  }
  int all = 0;
  MPI_Allreduce(&failures, &all, 1, MPI_INT, MPI_SUM, MPI_COMM_WORLD);
  MPI_Finalize();
  if (rank == 0) std::printf("%s\n", all == 0 ? "the same bits" : "FAILED");
  return all == 0 ? 0 : 1;
}
