// For mpirun: the same bits on all ranks together as in each process alone. Compiled by tests/ranks/mpi/run.py against
// the mpi.h of each MPI that is there.
//   solve [stop RANK AT]    RANK stops (dies, with AT = 0) after so many systems
//   solve gpu:all           each rank on a GPU; alone on the first that it sees
//   solve gpu:all process   ... and each a machine of its own; or host; or pairs: two ranks are one
//   solve gpu:all process time elasticity 64    that system alone: seconds, and a number that equal solutions have
//   solve cpu host rate [KIB]    messages of so many KiB (256) each way between ranks 0 and 1, in bytes a second
#include <espalier/mpi.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <complex>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <espalier/complex_solver.hpp>
#include <espalier/espalier.hpp>
#include <espalier/nodes.hpp>
#include <string>
#include <vector>

#include "matrix/generators/generate.hpp"
#include "ranks/communicator.hpp"

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

void check(const espalier::Ranks& ranks, const std::vector<std::string>& words, bool one_has_none,
           espalier::Precision precision = espalier::Precision::fp64) {
  const espalier::SparseMatrix a = espalier::matrix::generate(espalier::matrix::parse_generator(words));
  const Index n = a.rows, parts = one_has_none ? ranks.size() - 1 : ranks.size(), me = ranks.rank();
  const auto border = [&](Index r) { return static_cast<Index>(Offset{n} * std::min(r, parts) / parts); };
  const Index first = border(me), count = border(me + 1) - first;
  espalier::Options options;
  options.threads = 1;
  options.device = device == "cpu" ? device : "gpu:0";
  options.precision = precision;
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
  constexpr Index kColumns = 9;
  std::vector<double> many, many_truth(truth.size() * kColumns), part_of_many;
  for (Index c = 0; c < kColumns; ++c) {
    for (Index i = 0; i < n; ++i) many.push_back(b[i] + 0.1 * c);
    part_of_many.insert(part_of_many.end(), many.end() - n + first, many.end() - n + first + count);
  }
  expect(alone.solve(many, many_truth, kColumns).status.ok(), "alone");
  const auto solved_many = solver.solve(part_of_many, part_of_many, kColumns);
  expect(solved_many.status.ok(), solved_many.status.message);
  for (Index c = 0; c < kColumns && count > 0; ++c)
    expect(std::memcmp(part_of_many.data() + c * count, many_truth.data() + Offset{c} * n + first,
                       x.size() * sizeof(double)) == 0,
           words[0] + ": other bits of many");
}

// Few values change, and sub-trees that they do not reach are kept. Alone everything is made.
void check_partial(const espalier::Ranks& ranks, const std::vector<std::string>& words) {
  espalier::SparseMatrix a = espalier::matrix::generate(espalier::matrix::parse_generator(words));
  const Index n = a.rows, me = ranks.rank();
  const Index first = n * me / ranks.size(), count = n * (me + 1) / ranks.size() - first;
  espalier::Options options;
  options.threads = 1;
  options.device = "cpu";
  espalier::Solver alone(options);
  options.partial_refactorization = true;
  espalier::Solver solver(ranks, options);
  Rows part = rows_of(a, first, first + count);
  expect(alone.analyze(a).status.ok(), "alone");
  const auto analysis = solver.analyze(espalier::LocalRows{n, first, part.ptr, part.col, part.values, a.storage});
  expect(analysis.status.ok(), analysis.status.message);
  double least = 1;
  for (Index k = 0; k < 5; ++k) {
    a.values[static_cast<std::size_t>(a.col_ptr[static_cast<std::size_t>(k * n / 5)])] *= 1.5;
    part = rows_of(a, first, first + count);
    const auto factor = solver.refactorize(part.values);
    expect(factor.status.ok(), factor.status.message);
    least = std::min(least, factor.work_share);
    std::vector<double> b(static_cast<std::size_t>(n), 1.0), truth(b.size()), x(static_cast<std::size_t>(count), 1.0);
    expect(alone.refactorize(a.values).status.ok() && alone.solve(b, truth).status.ok(), "alone");
    const auto solved = solver.solve(x, x);
    expect(solved.status.ok(), solved.status.message);
    expect(count == 0 || std::memcmp(x.data(), truth.data() + first, x.size() * sizeof(double)) == 0,
           words[0] + ": other bits where few values change");
  }
  expect(least < 1, words[0] + ": every rank has made everything");
}

// A damped system, of which the last rank has no rows.
void check_complex(const espalier::Ranks& ranks, const std::vector<std::string>& words) {
  using Value = std::complex<double>;
  const espalier::SparseMatrix a = espalier::matrix::generate(espalier::matrix::parse_generator(words));
  const Index n = a.rows, parts = std::max(1, ranks.size() - 1), me = ranks.rank();
  const auto border = [&](Index r) { return static_cast<Index>(Offset{n} * std::min(r, parts) / parts); };
  const Index first = border(me), count = border(me + 1) - first;
  const auto damped = [](const std::vector<double>& values) {
    std::vector<Value> v;
    for (const double x : values) v.emplace_back(x, 0.1 * x);
    return v;
  };
  espalier::Options options;
  options.threads = 1;
  options.device = device == "cpu" ? device : "gpu:0";
  std::vector<Value> b(static_cast<std::size_t>(n)), truth(b.size());
  for (Index i = 0; i < n; ++i) b[i] = {1.0 / (1 + i % 17) - 0.3, 0.2 * (i % 5)};
  const espalier::ComplexSparseMatrix whole{n, n, a.col_ptr, a.row_ind, damped(a.values), a.storage};
  espalier::ComplexSolver alone(options);
  expect(alone.analyze(whole).status.ok() && alone.factorize(whole).status.ok() && alone.solve(b, truth).status.ok(),
         "complex, alone");
  options.device = device;
  espalier::ComplexSolver solver(ranks, options);
  const Rows part = rows_of(a, first, first + count);
  const std::vector<Value> values = damped(part.values);
  const auto analysis = solver.analyze(espalier::ComplexLocalRows{n, first, part.ptr, part.col, values, a.storage});
  expect(analysis.status.ok(), analysis.status.message);
  const auto factor = solver.refactorize(values);
  expect(factor.status.ok(), factor.status.message);
  std::vector<Value> x(b.begin() + first, b.begin() + first + count);
  const auto solved = solver.solve(x, x);
  expect(solved.status.ok(), solved.status.message);
  expect(count == 0 || std::memcmp(x.data(), truth.data() + first, x.size() * sizeof(Value)) == 0,
         "complex " + words[0] + ": other bits");
}

double now() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

void time_of(const espalier::Ranks& ranks, const std::vector<std::string>& words) {
  const espalier::SparseMatrix a = espalier::matrix::generate(espalier::matrix::parse_generator(words));
  const Index n = a.rows, me = ranks.rank();
  const auto border = [&](Index r) { return static_cast<Index>(Offset{n} * r / ranks.size()); };
  const Index first = border(me), count = border(me + 1) - first;
  espalier::Options options;
  options.device = device;
  espalier::Solver solver(ranks, options);
  const Rows part = rows_of(a, first, first + count);
  const auto analysis = solver.analyze(espalier::LocalRows{n, first, part.ptr, part.col, part.values, a.storage});
  expect(analysis.status.ok(), analysis.status.message);
  if (!analysis.status.ok()) return;
  double factor = 1e9, call = 1e9, solve = 1e9;
  std::vector<double> x(static_cast<std::size_t>(count));
  for (int k = 0; k < 5; ++k) {
    const double begin = now();
    const auto done = solver.refactorize(part.values);
    call = std::min(call, now() - begin);
    expect(done.status.ok(), done.status.message);
    if (!done.status.ok()) return;
    if (!done.devices.empty())
      factor = std::min(factor, done.devices[0].busy_seconds / (1 - done.devices[0].idle_fraction));
  }
  for (int k = 0; k < 3; ++k) {
    for (Index i = 0; i < count; ++i) x[i] = 1.0 / (1 + (first + i) % 17) - 0.3;
    const double begin = now();
    const auto solved = solver.solve(x, x);
    solve = std::min(solve, now() - begin);
    expect(solved.status.ok(), solved.status.message);
  }
  std::uint64_t mark = 0, all = 0;
  for (Index i = 0; i < count; ++i) {
    std::uint64_t bits = 0;
    std::memcpy(&bits, &x[i], sizeof bits);
    bits = (bits ^ (static_cast<std::uint64_t>(first + i) << 17)) * 0x9e3779b97f4a7c15u;
    mark ^= bits ^ bits >> 29;
  }
  MPI_Reduce(&mark, &all, 1, MPI_UINT64_T, MPI_BXOR, 0, MPI_COMM_WORLD);
  if (me == 0)
    std::printf("%s %s: factorization %.6f s (call %.6f), solve %.6f s, solution %016llx\n", words[0].c_str(),
                words[1].c_str(), factor, call, solve, static_cast<unsigned long long>(all));
}

// What the link carries, with memory that was used before as that of an exchange between machines is.
void rate_of(espalier::ranks::Communicator& link, std::size_t bytes) {
  constexpr std::size_t kAll = std::size_t{1} << 30, kInWork = std::size_t{16} << 20;
  const int messages_in_all = static_cast<int>(kAll / bytes), at_once = std::max(2, static_cast<int>(kInWork / bytes));
  constexpr int kRounds = 2;                                 // the first shows what is slow at the beginning
  std::vector<espalier::ranks::Message> of_rounds[kRounds];  // what is on its way is not written into
  for (auto& messages : of_rounds)
    for (int k = 0; k < at_once; ++k) {
      messages.emplace_back(bytes);
      std::memset(messages.back().body(), k, bytes);
    }
  link.begin_call();
  for (auto& messages : of_rounds) {
    link.begin_operation();
    int posted = 0, come = 0;
    const int other = 1 - link.rank();
    const double begin = now();
    link.wait([&](int, const espalier::ranks::Message&) { ++come; },
              [&] {
                const bool all_sent = posted == messages_in_all;  // posted before the last round, which has sent it
                for (; posted < messages_in_all && posted < come + at_once; ++posted)
                  link.post(std::span<const int>(&other, 1), messages[static_cast<std::size_t>(posted % at_once)]);
                return all_sent && come == messages_in_all;
              });
    if (link.rank() == 0)
      std::printf("%zu KiB: %.3g bytes a second each way\n", bytes >> 10,
                  static_cast<double>(bytes) * messages_in_all / (now() - begin));
  }
  expect(link.end_call({}).ok(), "rate");
}

}  // namespace

int main(int argc, char** argv) {
  MPI_Init(&argc, &argv);
  int rank = 0;
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  const std::vector<std::string> words(argv + 1, argv + argc);
  const bool named = !words.empty() && words[0] != "stop" && words[0] != "die";
  if (named) device = words[0];
  const int stopped = argc > 3 && !named ? std::atoi(argv[2]) : -1;
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
    if (words.size() > 1 && words[1] == "process") set_nodes(ranks, espalier::Nodes::process);
    if (words.size() > 1 && words[1] == "pairs") ranks.link()->set_machines(2);
    if (words.size() > 2 && words[2] == "rate") {
      if (ranks.size() == 2)
        rate_of(*ranks.link(), std::size_t{1024} * std::stoul(words.size() > 3 ? words[3] : "256"));
    } else if (words.size() > 3 && words[2] == "time") {
      time_of(ranks, {words.begin() + 3, words.end()});
    } else {
      check(ranks, {"elasticity", "7", "5", "4"}, false);
      check(ranks, {"kkt", "3", "4", "2", "2"}, ranks.size() > 1);
      check(ranks, {"gyroscopic", "5", "4", "4"}, false);
      check(ranks, {"elasticity", "6", "5", "4"}, false, espalier::Precision::mixed);
      if (device == "cpu") {
        check_partial(ranks, {"elasticity", "7", "6", "5"});
        check_partial(ranks, {"kkt", "5", "4", "2", "2"});
        check_partial(ranks, {"gyroscopic", "6", "5", "4"});
      }
      check_complex(ranks, {"elasticity", "6", "5", "4"});
      check_complex(ranks, {"gyroscopic", "5", "4", "4"});
    }
  }
  int all = 0;
  MPI_Allreduce(&failures, &all, 1, MPI_INT, MPI_SUM, MPI_COMM_WORLD);
  MPI_Finalize();
  if (rank == 0) std::printf("%s\n", all == 0 ? "the same bits" : "FAILED");
  return all == 0 ? 0 : 1;
}
