#include "dynamics/model/run/newton_solver.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>

#include "matrix/matrix_market.hpp"
#include "solver/options/option_text.hpp"

namespace espalier::dynamics::model {
namespace {

/// Compares the two halves of matrices of one pattern.
class SymmetryCheck {
 public:
  explicit SymmetryCheck(const MatrixView& a) {
    std::vector<Offset> next(a.col_ptr.begin(), a.col_ptr.end());
    mirror_.assign(a.row_ind.size(), -1);
    // Columns in turn: the entries (j, i) with j < i of column i come in the order of j.
    const auto at = [](Offset k) { return static_cast<std::size_t>(k); };
    for (Index j = 0; j < a.cols; ++j)
      for (Offset k = a.col_ptr[at(j)]; k < a.col_ptr[at(j) + 1]; ++k) {
        const Index i = a.row_ind[at(k)];
        if (i <= j) continue;
        Offset& other = next[at(i)];
        while (other < a.col_ptr[at(i) + 1] && a.row_ind[at(other)] < j) ++other;
        if (other < a.col_ptr[at(i) + 1] && a.row_ind[at(other)] == j) mirror_[at(k)] = other;
      }
  }
  /// max |a_ij - a_ji| / max |a_ij|, of entries below the diagonal that have a mirror image in the pattern
  [[nodiscard]] double largest_difference(std::span<const double> values) const {
    double most = 0, size = 0;
    for (std::size_t k = 0; k < mirror_.size(); ++k) {
      size = std::max(size, std::abs(values[k]));
      if (mirror_[k] >= 0) most = std::max(most, std::abs(values[k] - values[static_cast<std::size_t>(mirror_[k])]));
    }
    return size > 0 ? most / size : 0.0;
  }

 private:
  std::vector<Offset> mirror_;  // of every entry below the diagonal the one above; -1: none
};

/// Analyses that simulations share through a folder, a file for each pattern and kind. What cannot be read or written
/// costs an analysis, no more.
class KeptAnalyses {
 public:
  explicit KeptAnalyses(std::string folder) : folder_(std::move(folder)) {}
  [[nodiscard]] bool any() const { return !folder_.empty(); }

  AnalysisResult analyze(Solver& solver, const MatrixView& a) const {
    if (folder_.empty()) return solver.analyze(a);
    const std::string path =
        fmt::format("{}/{:016x}-{}.analysis", folder_, hash(a), static_cast<int>(solver.options().kind));
    std::error_code absent;
    if (std::filesystem::exists(path, absent)) {
      AnalysisResult loaded = solver.load_analysis(path, a);
      if (loaded.status.ok() || loaded.status.code == StatusCode::cancelled) return loaded;
    }
    AnalysisResult made = solver.analyze(a);
    if (made.status.ok()) {  // under another name at first: others may be reading
      const std::string part = fmt::format("{}.{}.part", path, ::getpid());
      if (solver.save_analysis(part).ok()) std::filesystem::rename(part, path, absent);
    }
    return made;
  }

 private:
  // FNV-1a of 64-bit words, for names; the file itself holds a hash that load_analysis() checks.
  static std::uint64_t hash(const MatrixView& a) {
    std::uint64_t h = 0xcbf29ce484222325;
    const auto add = [&h](auto range) {
      for (const auto x : range) h = (h ^ static_cast<std::uint64_t>(x)) * 0x100000001b3;
    };
    add(a.col_ptr);
    add(a.row_ind);
    return h;
  }

  std::string folder_;
};

/// Espalier's solver, as make_espalier_solver(), with a record.
class RecordedSolver final : public LinearSolver {
 public:
  RecordedSolver(Options options, const std::string& analyses, SolverRecord& record,
                 std::unique_ptr<SharedNewton> shared)
      : shared_(std::move(shared)),
        solver_(shared_ ? shared_->ranks() : Ranks(), std::move(options)),
        kept_(analyses),
        record_(record) {}

  Status analyze(const MatrixView& a) override {
    if (Status status = tell(Call::analyze); !status.ok()) return status;
    return take(kept_.analyze(solver_, as_stored(a)));
  }
  Status analyze_change(const MatrixView& a) override {
    if (kept_.any()) return analyze(a);
    if (Status status = tell(Call::analyze_change); !status.ok()) return status;
    ChangeResult change = solver_.analyze_change(as_stored(a));
    record_.followed += change.analysis.status.ok() && !change.full ? 1 : 0;
    return take(std::move(change.analysis));
  }
  Status factorize(std::span<const double> values) override {
    if (symmetry_) {
      const double asymmetry = symmetry_->largest_difference(values);
      record_.largest_asymmetry = std::max(record_.largest_asymmetry, asymmetry);
      record_.unsymmetric += asymmetry > kAsymmetry ? 1 : 0;
    }
    if (Status status = tell(Call::factorize); !status.ok()) return status;
    return take(solver_.refactorize(values));
  }
  // Symmetry is looked at on the host, and ranks take what lies there.
  [[nodiscard]] int gpu() const override { return symmetry_ || shared_ ? -1 : solver_.gpu(); }
  [[nodiscard]] GpuPlaces gpu_places() const override { return gpu() < 0 ? GpuPlaces{} : solver_.gpu_places(); }
  Status factorize_device(const double* values, Offset count, void* stream) override {
    return take(solver_.refactorize_device(values, count, stream));
  }
  Status solve_device(double* b, Index columns, void* stream) override {
    return solver_.solve_device(b, b, columns, Transpose::no, stream).status;
  }
  [[nodiscard]] int determinant_sign() const override { return static_cast<int>(record_.factor.determinant_sign); }
  [[nodiscard]] FactorWork work() const override { return work_of(record_.analysis); }
  Status solve(std::span<const double> b, std::span<double> x, Index columns) override {
    if (Status status = tell(Call::solve, columns); !status.ok()) return status;
    return solver_.solve(b, x, columns).status;
  }

 private:
  using Call = SharedNewton::Call;
  // The other ranks, where there are any, join in the call that follows.
  Status tell(Call call, Index columns = 0) const { return shared_ ? shared_->announce(call, columns) : Status{}; }
  MatrixView as_stored(MatrixView a) {
    // Chosen by the user, who knows that no force makes the tangent unsymmetric.
    if (solver_.options().kind == Kind::ldlt) {
      symmetry_ = std::make_unique<SymmetryCheck>(a);
      a.storage = Storage::symmetric_both;
    }
    return a;
  }
  Status take(AnalysisResult result) {
    record_.analysis = std::move(result);
    record_.analysis_seconds += record_.analysis.seconds;
    return record_.analysis.status;
  }
  Status take(FactorResult result) {
    record_.factor = std::move(result);
    // Perturbed pivots mean a singular K here: redundant constraints that nobody took out.
    if (record_.factor.status.ok() && record_.factor.perturbed > 0)
      return {StatusCode::singular, fmt::format("{} pivots vanished", record_.factor.perturbed),
              record_.factor.status.row};
    return record_.factor.status;
  }

  /// Newton's iteration contracts by about so much when it sees one half for both. Turning bodies always make a little.
  static constexpr double kAsymmetry = 1e-3;
  std::unique_ptr<SharedNewton> shared_;
  Solver solver_;
  KeptAnalyses kept_;
  SolverRecord& record_;
  std::unique_ptr<SymmetryCheck> symmetry_;
};

/// Hands everything on; writes each chosen matrix with the first right-hand sides that it is solved for.
class DumpingSolver final : public LinearSolver {
 public:
  DumpingSolver(std::unique_ptr<LinearSolver> inner, DumpOptions options, SolverRecord& record)
      : inner_(std::move(inner)), options_(std::move(options)), record_(record) {
    std::error_code error;
    std::filesystem::create_directories(options_.folder, error);
    if (error)
      throw Error(StatusCode::invalid_input,
                  fmt::format("cannot make the folder '{}': {}", options_.folder, error.message()));
  }

  Status analyze(const MatrixView& a) override {
    copy_pattern(a);
    return inner_->analyze(a);
  }
  Status analyze_change(const MatrixView& a) override {
    copy_pattern(a);
    return inner_->analyze_change(a);
  }
  Status factorize(std::span<const double> values) override {
    waiting_ = record_.dumped < options_.most && count_ % options_.every == 0;
    ++count_;
    if (waiting_) values_.assign(values.begin(), values.end());
    Status status = inner_->factorize(values);
    if (waiting_ && !status.ok()) {  // there will be no right-hand sides; who looks for the reason needs the matrix
      waiting_ = false;
      matrix::write_matrix_market(fmt::format("{}/newton_{:04}.mtx", options_.folder, ++record_.dumped),
                                  {rows_, rows_, ptr_, ind_, values_, storage_},
                                  fmt::format("Newton matrix of factorization {}, which failed", count_));
    }
    return status;
  }
  [[nodiscard]] int determinant_sign() const override { return inner_->determinant_sign(); }
  [[nodiscard]] FactorWork work() const override { return inner_->work(); }
  Status solve(std::span<const double> b, std::span<double> x, Index columns) override {
    if (waiting_) write(b, columns);
    waiting_ = false;
    return inner_->solve(b, x, columns);
  }

 private:
  void copy_pattern(const MatrixView& a) {
    rows_ = a.rows;
    ptr_.assign(a.col_ptr.begin(), a.col_ptr.end());
    ind_.assign(a.row_ind.begin(), a.row_ind.end());
    storage_ = a.storage;
  }
  void write(std::span<const double> b, Index columns) {
    const std::string stem = fmt::format("{}/newton_{:04}", options_.folder, record_.dumped + 1);
    matrix::write_matrix_market(stem + ".mtx", {rows_, rows_, ptr_, ind_, values_, storage_},
                                fmt::format("Newton matrix of factorization {}", count_));
    matrix::write_matrix_market_vectors(stem + "_rhs.mtx", rows_, columns, b);
    ++record_.dumped;
  }

  std::unique_ptr<LinearSolver> inner_;
  DumpOptions options_;
  SolverRecord& record_;
  Index rows_ = 0;
  Storage storage_ = Storage::general;
  std::vector<Offset> ptr_;
  std::vector<Index> ind_;
  std::vector<double> values_;
  long count_ = 0;
  bool waiting_ = false;
};

}  // namespace

Options run_options(const std::vector<std::pair<std::string, std::string>>& by_name, Index unknowns) {
  Options given;
  for (const auto& [key, value] : by_name) solver::set_option(given, key, value);
  Options options = newton_options(unknowns, given.precision);
  for (const auto& [key, value] : by_name) solver::set_option(options, key, value);
  if (options.kind == Kind::automatic) options.kind = Kind::lu;
  return options;
}

std::unique_ptr<LinearSolver> make_run_solver(const Options& options, bool dense, const DumpOptions& dump,
                                              const std::string& analyses, SolverRecord& record,
                                              std::unique_ptr<SharedNewton> shared) {
  record.dense = dense;
  record.options = options;
  std::unique_ptr<LinearSolver> solver;
  if (dense) {
    solver = make_dense_solver();
  } else {
    solver = std::make_unique<RecordedSolver>(options, analyses, record, std::move(shared));
  }
  if (!dump.folder.empty()) solver = std::make_unique<DumpingSolver>(std::move(solver), dump, record);
  return solver;
}

}  // namespace espalier::dynamics::model
