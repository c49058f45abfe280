// Many small systems of one pattern: Batch beside MKL PARDISO in a loop, with all threads in PARDISO, or one loop a
// thread.
//   espalier_bench_batch [COUNT [UNKNOWNS [THREADS [SORT [DEVICE]]]]]     default: 1,000 KKT systems of about 500
//   unknowns, all cores
//   espalier_bench_batch 10000 500 0 kkt gpu:0     ours on that device, in chunks and one by one, beside cuDSS's
//   uniform batch, without its matching and with it, and with two steps of its refinement
//   espalier_bench_batch patterns [COUNT [LEAST [MOST [THREADS [DEVICE]]]]]     solve_systems(): 10,000 systems of 100
//   to 2,000 unknowns, each of a pattern of its own, on the cores, on gpu:0, and where device auto has them solved
// SORT: kkt (saddle points, ldlt) or grid (Poisson on a square, llt). COUNT systems with values of their own and one
// right-hand side each. PARDISO: one analysis a handle, then phase 23 and phase 33 for each system, with its own
// refinement. Every answer is checked; the largest backward errors stand beside the times. Medians of three rounds.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstdlib>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "base/thread_pool.hpp"
#include "batch_cudss.hpp"
#include "batch_patterns.hpp"
#include "espalier/batch.hpp"
#include "in_turns.hpp"
#include "matrix/generators/generate.hpp"
#include "rivals/rival.hpp"
#include "rivals/shared_library.hpp"

namespace {

using namespace espalier;
using bench::median;
using bench::seconds_of;

// [K B^T; B 0]: a grid's K, and a constraint for every fourth unknown; every diagonal entry is stored (PARDISO asks for
// it).
SparseMatrix saddle_point(Index n) {
  const Index m = n / 5, k = n - m;
  SparseMatrix a;
  a.rows = a.cols = n;
  a.storage = Storage::symmetric_lower;
  a.col_ptr.push_back(0);
  const auto side = static_cast<Index>(std::sqrt(k));
  for (Index c = 0; c < n; ++c) {
    const auto add = [&](Index r, double v) {
      a.row_ind.push_back(r);
      a.values.push_back(v);
    };
    add(c, c < k ? 4.5 : 0.0);
    if (c < k) {
      if (c + 1 < k && (c + 1) % side != 0) add(c + 1, -1);
      if (c + side < k) add(c + side, -1);
      for (Index j = 0; j < m; ++j)
        if (c == 4 * j % k || c == (4 * j + 1) % k) add(k + j, c % 2 == 0 ? 1 : -0.5);
    }
    a.col_ptr.push_back(static_cast<Offset>(a.row_ind.size()));
  }
  return a;
}

double backward_error(const SparseMatrix& a, const double* values, const double* b, const double* x) {
  std::vector<double> r(b, b + a.cols), row(static_cast<std::size_t>(a.cols), 0.0);
  for (Index c = 0; c < a.cols; ++c)
    for (Offset q = a.col_ptr[static_cast<std::size_t>(c)]; q < a.col_ptr[static_cast<std::size_t>(c) + 1]; ++q) {
      const Index i = a.row_ind[static_cast<std::size_t>(q)];
      r[static_cast<std::size_t>(i)] -= values[q] * x[c];
      row[static_cast<std::size_t>(i)] += std::abs(values[q]);
      if (i == c) continue;
      r[static_cast<std::size_t>(c)] -= values[q] * x[i];
      row[static_cast<std::size_t>(c)] += std::abs(values[q]);
    }
  double of_r = 0, of_x = 0, of_b = 0, of_a = 0;
  for (Index i = 0; i < a.cols; ++i) {
    of_r = std::max(of_r, std::abs(r[static_cast<std::size_t>(i)]));
    of_x = std::max(of_x, std::abs(x[i]));
    of_b = std::max(of_b, std::abs(b[i]));
    of_a = std::max(of_a, row[static_cast<std::size_t>(i)]);
  }
  return of_r / (of_a * of_x + of_b);
}

struct Mkl {
  using Call = void (*)(void*, const int*, const int*, const int*, const int*, const int*, const void*, const int*,
                        const int*, int*, const int*, int*, const int*, void*, void*, int*);
  bench::SharedLibrary gomp{{"libgomp.so.1"}, bench::SharedLibrary::Scope::global};
  bench::SharedLibrary core{{"libmkl_core.so.3", "libmkl_core.so.2"}, bench::SharedLibrary::Scope::global};
  bench::SharedLibrary threads{{"libmkl_gnu_thread.so.3", "libmkl_gnu_thread.so.2"},
                               bench::SharedLibrary::Scope::global};
  bench::SharedLibrary interface {
    {"libmkl_intel_lp64.so.3", "libmkl_intel_lp64.so.2"}, bench::SharedLibrary::Scope::global
  };
  Call call = interface.function<Call>("pardiso");
};

class Pardiso {
 public:
  Pardiso(const Mkl& mkl, const SparseMatrix& a, bool definite) : mkl_(mkl), n_(a.cols), mtype_(definite ? 2 : -2) {
    for (const Offset p : a.col_ptr) pointers_.push_back(static_cast<int>(p) + 1);
    for (const Index r : a.row_ind) columns_.push_back(r + 1);
    iparm_[0] = 1;
    iparm_[1] = 2;
    iparm_[7] = 2;
    iparm_[9] = 8;
    if (!definite) iparm_[10] = iparm_[12] = 1;
    run(11, a.values.data(), nullptr, nullptr);
  }
  void solve(const double* values, const double* b, double* x) {
    run(22, values, nullptr, nullptr);
    run(33, values, const_cast<double*>(b), x);  // the solver does not write there
  }

 private:
  void run(int phase, const double* values, double* b, double* x) {
    const int one = 1, silent = 0;
    int error = 0;
    mkl_.call(handle_.data(), &one, &one, &mtype_, &phase, &n_, values, pointers_.data(), columns_.data(), nullptr,
              &one, iparm_.data(), &silent, b, x, &error);
    if (error != 0) throw std::runtime_error(fmt::format("PARDISO: error {} in phase {}", error, phase));
  }
  const Mkl& mkl_;
  int n_, mtype_;
  std::vector<int> pointers_, columns_;
  std::array<void*, 64> handle_{};
  std::array<int, 64> iparm_{};
};

struct Problem {
  Problem(Index the_count, Index unknowns, bool is_definite) : count(the_count), definite(is_definite) {
    a = saddle_point(unknowns);
    if (definite) {
      const std::string side = std::to_string(std::max(2, static_cast<int>(std::sqrt(unknowns))));
      a = matrix::generate(matrix::parse_generator(std::vector<std::string>{"poisson", side, side, "1"}));
    }
    std::mt19937_64 random(1);
    b.resize(static_cast<std::size_t>(a.cols) * static_cast<std::size_t>(count));
    for (Index k = 0; k < count; ++k)
      for (const double v : a.values) values.push_back(v * (1 + static_cast<double>(random() % 1000) / 20000));
    for (double& v : b) v = static_cast<double>(random() % 2000) / 1000 - 1;
  }

  [[nodiscard]] double worst_error(const std::vector<double>& x) const {
    double most = 0;
    for (std::size_t k = 0; k < static_cast<std::size_t>(count); ++k) {
      const std::size_t n = static_cast<std::size_t>(a.cols) * k;
      most = std::max(most, backward_error(a, values.data() + k * a.values.size(), b.data() + n, x.data() + n));
    }
    return most;
  }
  [[nodiscard]] Options options(int threads) const {
    Options o;
    o.threads = threads;
    o.kind = definite ? Kind::llt : Kind::ldlt;
    return o;
  }
  void print_head(int threads) const {
    fmt::print("{} systems of {} unknowns, {} entries ({}), {} threads\n", count, a.cols, a.values.size(),
               definite ? "llt" : "ldlt", threads);
  }

  SparseMatrix a;
  Index count;
  bool definite;
  std::vector<double> values, b;
};

// cuDSS's uniform batch. Its times are lines of their own: answers are told, not judged.
void run_cudss(const Problem& p) {
  constexpr int kRounds = 4;
  for (const bool matching : {false, true})
    for (const int steps : {0, 2}) {
      if (p.definite && (matching || steps > 0)) continue;
      const std::string name = fmt::format("cuDSS uniform batch{}{}", matching ? ", matching" : "",
                                           steps > 0 ? fmt::format(", {} steps of refinement", steps) : "");
      try {
        std::vector<double> x(p.b.size()), whole, phases;
        bench::CudssBatch batch(p.a, p.values, p.count, {p.definite, matching, steps});
        double error = 0;
        for (int round = 0; round < kRounds; ++round) {
          const bench::CudssBatchTimes times = batch.solve(p.values, p.b, x);
          error = p.worst_error(x);
          if (round == 0) continue;
          whole.push_back(times.whole);
          phases.push_back(times.phases);
        }
        fmt::print("{}: {:.4f} s, {:.2f} us a system (on the GPU alone {:.4f} s); backward errors {:.1e}\n", name,
                   median(whole), 1e6 * median(whole) / p.count, median(phases), error);
      } catch (const std::exception& e) {
        fmt::print("{}: {}\n", name, e.what());
      }
    }
}

// Ours, in chunks and one by one.
int run_on_device(const Problem& p, int threads, const std::string& device) {
  p.print_head(threads);
  double error = 0;
  for (const char* chunk : {"", "0"}) {
    if (*chunk != '\0') ::setenv("ESPALIER_BATCH_CHUNK", chunk, 1);
    Options options = p.options(threads);
    options.device = device;
    options.log = [](const std::string& line) { fmt::print("  {}\n", line); };
    Batch batch(options);
    if (const AnalysisResult analysis = batch.analyze(p.a); !analysis.status.ok())
      throw std::runtime_error(analysis.status.message);
    std::vector<double> x(p.b.size()), times;
    double first = 0;  // with the plan of a chunk
    const int rounds = *chunk == '\0' ? 4 : 2;
    for (int round = 0; round < rounds; ++round) {
      const BatchResult result = batch.solve(p.values, p.b, x, p.count);
      if (!result.status.ok()) throw std::runtime_error(result.status.message);
      if (round == 0)
        first = result.seconds;
      else
        times.push_back(result.seconds);
      error = std::max(error, p.worst_error(x));
    }
    fmt::print("Batch on {}, {}: {:.4f} s, {:.2f} us a system (first call {:.4f} s); backward errors {:.1e}\n", device,
               *chunk == '\0' ? "together" : "one by one", median(times), 1e6 * median(times) / p.count, first, error);
  }
  if (device.starts_with("gpu")) run_cudss(p);
  return error < 1e-12 ? 0 : 1;
}

int run(const Problem& problem, int threads) {
  const SparseMatrix& a = problem.a;
  const std::vector<double>&values = problem.values, &b = problem.b;
  const auto n = static_cast<std::size_t>(a.cols), nonzeros = a.values.size();
  const Index count = problem.count;
  std::vector<double> x(b.size()), y(b.size());
  Batch batch(problem.options(threads));
  if (const AnalysisResult analysis = batch.analyze(a); !analysis.status.ok())
    throw std::runtime_error(analysis.status.message);
  const Mkl mkl;
  base::ThreadPool pool(threads);
  std::vector<std::unique_ptr<Pardiso>> handles;
  for (int t = 0; t < pool.size(); ++t) handles.push_back(std::make_unique<Pardiso>(mkl, a, problem.definite));
  const auto system = [&](Pardiso& p, Index k) {
    const auto at = static_cast<std::size_t>(k);
    p.solve(values.data() + at * nonzeros, b.data() + at * n, y.data() + at * n);
  };
  const auto set_threads = mkl.interface.function<int (*)(int)>("MKL_Set_Num_Threads_Local");
  std::vector<double> ours, loop, loops;
  double error = 0, of_loop = 0, of_loops = 0;
  for (int round = 0; round < 4; ++round) {
    BatchResult result;
    const double mine = seconds_of([&] { result = batch.solve(values, b, x, count); });
    if (!result.status.ok()) throw std::runtime_error(result.status.message);
    set_threads(threads);
    const double one = seconds_of([&] {
      for (Index k = 0; k < count; ++k) system(*handles[0], k);
    });
    error = problem.worst_error(x);
    of_loop = problem.worst_error(y);
    std::atomic<Index> next{0};
    const double each = seconds_of([&] {
      pool.share([&](int t) {
        set_threads(1);
        for (Index k = next++; k < count; k = next++) system(*handles[static_cast<std::size_t>(t)], k);
      });
    });
    of_loops = problem.worst_error(y);
    if (round == 0) continue;
    ours.push_back(mine);
    loop.push_back(one);
    loops.push_back(each);
  }
  const auto line = [&](const char* name, double seconds, double of) {
    fmt::print("{:36} {:>9.4f} s  {:>8.2f} us a system  {:>6.2f} times ours; backward errors {:.1e}\n", name, seconds,
               1e6 * seconds / count, seconds / median(ours), of);
  };
  problem.print_head(pool.size());
  line("Batch", median(ours), error);
  line("PARDISO in a loop, all threads", median(loop), of_loop);
  line("PARDISO, a loop on each thread", median(loops), of_loops);
  return error < 1e-12 ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    if (argc > 1 && std::string(argv[1]) == "patterns") {
      bench::ManyPatterns wish;
      if (argc > 2) wish.count = std::atoi(argv[2]);
      if (argc > 3) wish.least = std::atoi(argv[3]);
      if (argc > 4) wish.most = std::atoi(argv[4]);
      wish.threads = argc > 5 && std::atoi(argv[5]) > 0 ? std::atoi(argv[5]) : base::available_cores();
      if (argc > 6) wish.device = argv[6];
      return bench::run_many_patterns(wish);
    }
    const int asked = argc > 3 ? std::atoi(argv[3]) : 0, threads = asked > 0 ? asked : base::available_cores();
    const Problem problem(argc > 1 ? std::atoi(argv[1]) : 1000, argc > 2 ? std::atoi(argv[2]) : 500,
                          argc > 4 && std::string(argv[4]) == "grid");
    return argc > 5 ? run_on_device(problem, threads, argv[5]) : run(problem, threads);
  } catch (const std::exception& e) {
    fmt::print(stderr, "espalier_bench_batch: {}\n", e.what());
    return 1;
  }
}
