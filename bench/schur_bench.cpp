// Condensing onto some unknowns, beside MKL PARDISO (iparm(36)) and MUMPS (ICNTL(19)), on the same matrix in one
// process.
//   espalier_bench_schur [system words] [--list N] [--threads N] [--scattered] [--repeats N] [--alone]
// The list: the last N unknowns in the grid's order (a part of a face), or N at random. Solvers take turns; seconds are
// medians of the numeric phase alone (PARDISO: phase 22, MUMPS: job 2), ours the whole call of factorize(). The largest
// difference from our S stands beside each rival's time, over the largest entry of S; ours is checked by a solve of the
// whole system, whose backward error is that of matrix::backward_errors.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <random>
#include <string>
#include <vector>

#ifdef ESPALIER_BENCH_MUMPS
#include <dmumps_c.h>
#endif

#include "espalier/schur.hpp"
#include "in_turns.hpp"
#include "matrix/generators/generate.hpp"
#include "matrix/residual.hpp"
#include "matrix/transform.hpp"
#include "rivals/rival.hpp"
#include "rivals/shared_library.hpp"

namespace {

using namespace espalier;
using bench::median;
using bench::seconds_of;

struct Job {
  std::vector<std::string> words{"elasticity", "20"};
  Index listed = 500;
  int threads = 2;
  int repeats = 3;
  bool scattered = false;
  bool alone = false;
};

Job read_arguments(int argc, char** argv) {
  Job job;
  std::vector<std::string> words;
  for (int k = 1; k < argc; ++k) {
    const std::string word = argv[k];
    const auto number = [&] { return k + 1 < argc ? std::stoi(argv[++k]) : throw std::invalid_argument(word); };
    if (word == "--list")
      job.listed = number();
    else if (word == "--threads")
      job.threads = number();
    else if (word == "--repeats")
      job.repeats = number();
    else if (word == "--scattered")
      job.scattered = true;
    else if (word == "--alone")
      job.alone = true;
    else
      words.push_back(word);
  }
  if (!words.empty()) job.words = words;
  return job;
}

double difference(std::span<const double> s, const std::vector<double>& other, bool lower_alone) {
  const auto n = static_cast<std::size_t>(std::sqrt(static_cast<double>(s.size())) + 0.5);
  double most = 0, scale = 0;
  for (std::size_t c = 0; c < n; ++c)
    for (std::size_t r = lower_alone ? c : 0; r < n; ++r) {
      scale = std::max(scale, std::abs(s[c * n + r]));
      most = std::max(most, std::abs(s[c * n + r] - other[c * n + r]));
    }
  return most / scale;
}

/// One of those who condense, for the turns.
class Contestant {
 public:
  virtual ~Contestant() = default;
  virtual void factorize() = 0;
  [[nodiscard]] virtual double error(std::span<const double> s) const = 0;
  std::string name;
  std::vector<double> seconds;
};

/// Upper triangle by rows, 1-based: what both rivals take.
struct Rows {
  std::vector<int> pointers, columns;
  std::vector<double> values;
  explicit Rows(const SparseMatrix& lower) : values(lower.values) {
    for (const Offset p : lower.col_ptr) pointers.push_back(static_cast<int>(p) + 1);
    for (const Index r : lower.row_ind) columns.push_back(r + 1);
  }
};

class Pardiso final : public Contestant {
 public:
  Pardiso(const SparseMatrix& a, const std::vector<Index>& list, bool definite)
      : rows_(a), n_(a.cols), mtype_(definite ? 2 : -2), marked_(static_cast<std::size_t>(a.cols), 0) {
    name = "PARDISO";
    for (const Index v : list) marked_[static_cast<std::size_t>(v)] = 1;
    s_.resize(list.size() * list.size());
    iparm_[0] = 1;
    iparm_[1] = 3;
    if (!definite) iparm_[10] = iparm_[12] = 1;
    iparm_[9] = 8;
    iparm_[35] = list.empty() ? 0 : 2;
    call(11);
  }
  void factorize() override { call(22); }
  [[nodiscard]] double error(std::span<const double> s) const override { return difference(s, s_, true); }

 private:
  using Call = void (*)(void*, const int*, const int*, const int*, const int*, const int*, const void*, const int*,
                        const int*, int*, const int*, int*, const int*, void*, void*, int*);
  void call(int phase) {
    const int one = 1, silent = 0;
    int error = 0;
    interface_.function<Call>("pardiso")(handle_.data(), &one, &one, &mtype_, &phase, &n_, rows_.values.data(),
                                         rows_.pointers.data(), rows_.columns.data(), marked_.data(), &one,
                                         iparm_.data(), &silent, nullptr, s_.data(), &error);
    if (error != 0) throw std::runtime_error(fmt::format("PARDISO: error {} in phase {}", error, phase));
  }

  bench::SharedLibrary gomp_{{"libgomp.so.1"}, bench::SharedLibrary::Scope::global};
  bench::SharedLibrary core_{{"libmkl_core.so.3", "libmkl_core.so.2"}, bench::SharedLibrary::Scope::global};
  bench::SharedLibrary threads_{{"libmkl_gnu_thread.so.3", "libmkl_gnu_thread.so.2"},
                                bench::SharedLibrary::Scope::global};
  bench::SharedLibrary interface_{{"libmkl_intel_lp64.so.3", "libmkl_intel_lp64.so.2"},
                                  bench::SharedLibrary::Scope::global};
  Rows rows_;
  int n_, mtype_;
  std::vector<int> marked_;
  std::array<void*, 64> handle_{};
  std::array<int, 64> iparm_{};
  std::vector<double> s_;
};

#ifdef ESPALIER_BENCH_MUMPS
class Mumps final : public Contestant {
 public:
  Mumps(const SparseMatrix& a, const std::vector<Index>& list, bool definite)
      : rows_(a), s_(list.size() * list.size()) {
    name = "MUMPS";
    data_.sym = definite ? 1 : 2;
    data_.par = 1;
    data_.comm_fortran = -987654;  // MPI_COMM_WORLD
    job(-1);
    for (int k = 1; k <= 4; ++k) icntl(k) = k == 4 ? 0 : -1;
    icntl(28) = 1;
    icntl(14) = 60;
    for (Index c = 0; c < a.cols; ++c)
      for (Offset q = a.col_ptr[static_cast<std::size_t>(c)]; q < a.col_ptr[static_cast<std::size_t>(c) + 1]; ++q)
        columns_.push_back(c + 1);
    for (const Index v : list) list_.push_back(v + 1);
    data_.n = a.cols;
    data_.nnz = a.nonzeros();
    data_.irn = rows_.columns.data();
    data_.jcn = columns_.data();
    data_.a = rows_.values.data();
    if (!list.empty()) {
      icntl(19) = 1;
      data_.size_schur = static_cast<int>(list_.size());
      data_.listvar_schur = list_.data();
      data_.schur = s_.data();
    }
    job(1);
  }
  ~Mumps() override {
    data_.job = -2;
    dmumps_c(&data_);
  }
  void factorize() override { job(2); }
  // By rows, the lower triangle: by columns the upper one.
  [[nodiscard]] double error(std::span<const double> s) const override {
    std::vector<double> flipped(s_.size());
    const std::size_t n = list_.size();
    for (std::size_t c = 0; c < n; ++c)
      for (std::size_t r = 0; r < n; ++r) flipped[c * n + r] = s_[r * n + c];
    return difference(s, flipped, true);
  }

 private:
  int& icntl(int k) { return data_.icntl[k - 1]; }
  void job(int number) {
    data_.job = number;
    dmumps_c(&data_);
    if (data_.infog[0] < 0)
      throw std::runtime_error(fmt::format("MUMPS: INFOG(1) = {} in job {}", data_.infog[0], number));
  }

  Rows rows_;
  std::vector<int> columns_, list_;
  std::vector<double> s_;
  DMUMPS_STRUC_C data_{};
};
#endif

void add_rivals(std::vector<std::unique_ptr<Contestant>>& all, const SparseMatrix& a, const std::vector<Index>& list,
                bool definite) {
  const auto add = [&](auto make) {
    try {
      all.push_back(make());
    } catch (const std::exception& e) {
      fmt::print("left out: {}\n", e.what());
    }
  };
  add([&] { return std::make_unique<Pardiso>(a, list, definite); });
#ifdef ESPALIER_BENCH_MUMPS
  add([&] { return std::make_unique<Mumps>(a, list, definite); });
#endif
}

int run(const Job& job) {
  matrix::GeneratorSpec spec = matrix::parse_generator(job.words);
  spec.numbering = matrix::Numbering::natural;
  const SparseMatrix a = matrix::generate(spec);
  std::vector<Index> all(static_cast<std::size_t>(a.cols));
  std::iota(all.begin(), all.end(), 0);
  std::mt19937_64 random(1);
  if (job.scattered) std::shuffle(all.begin(), all.end(), random);
  std::vector<Index> list(all.end() - std::min<std::ptrdiff_t>(job.listed, std::ssize(all)), all.end());
  std::sort(list.begin(), list.end());  // PARDISO takes no order
  Options options;
  options.threads = job.threads;
  Solver solver(options);
  SchurComplement schur(options);
  const AnalysisResult whole = solver.analyze(a), condensed = schur.analyze(a, list);
  if (!whole.status.ok() || !condensed.status.ok())
    throw std::runtime_error(whole.status.message + condensed.status.message);
  std::vector<std::unique_ptr<Contestant>> rivals;
  if (!job.alone) add_rivals(rivals, a, list, whole.kind == Kind::llt);
  std::vector<double> factor_seconds, schur_seconds, forming;
  for (int k = 0; k <= job.repeats; ++k) {
    FactorResult f;
    SchurResult s;
    const double of_factor = seconds_of([&] { f = solver.refactorize(a.values); });
    const double of_schur = seconds_of([&] { s = schur.factorize(a.values); });
    if (!f.status.ok() || !s.status.ok()) throw std::runtime_error(f.status.message + s.status.message);
    if (k > 0) {
      factor_seconds.push_back(of_factor);
      schur_seconds.push_back(of_schur);
      forming.push_back(s.complement_seconds);
    }
    for (auto& r : rivals) {
      const double seconds = seconds_of([&] { r->factorize(); });
      if (k > 0) r->seconds.push_back(seconds);
    }
  }
  std::vector<double> b(static_cast<std::size_t>(a.cols), 1.0), x(b.size());
  const SolveResult solved = schur.solve(b, x);
  const double factor = median(factor_seconds);
  fmt::print("{} unknowns, {} listed ({}), {} threads; flops {:.3g} of A, {:.3g} of the rest\n", a.cols, list.size(),
             job.scattered ? "at random" : "part of a face", job.threads, whole.flops, condensed.flops);
  fmt::print("{:24} {:>9.4f} s\n", "factorization of A", factor);
  fmt::print("{:24} {:>9.4f} s  {:5.2f} factorizations; {:.4f} s of it form S; backward error of a solve {:.1e}\n",
             "SchurComplement", median(schur_seconds), median(schur_seconds) / factor, median(forming),
             solved.backward_error);
  for (const auto& r : rivals)
    fmt::print("{:24} {:>9.4f} s  {:5.2f} times ours; S differs by {:.1e}\n", r->name, median(r->seconds),
               median(r->seconds) / median(schur_seconds), r->error(schur.complement()));
  return solved.status.ok() ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(read_arguments(argc, argv));
  } catch (const std::exception& e) {
    fmt::print(stderr, "espalier_bench_schur: {}\n", e.what());
    return 1;
  }
}
