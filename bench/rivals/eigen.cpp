/// \file
/// Eigen's simplicial factorizations, which many simulators use: one thread, one column at a time.
#include <Eigen/SparseCholesky>
#include <Eigen/SparseLU>
#include <memory>
#include <variant>

#include "rivals/compressed.hpp"
#include "rivals/rival.hpp"
#include "rivals/variant.hpp"

namespace espalier::bench {
namespace {

using Sparse = Eigen::SparseMatrix<double, Eigen::ColMajor, int>;
using View = Eigen::Map<const Sparse>;
using Llt = Eigen::SimplicialLLT<Sparse, Eigen::Lower>;
using Ldlt = Eigen::SimplicialLDLT<Sparse, Eigen::Lower>;
using Lu = Eigen::SparseLU<Sparse>;

/// Entries of the factor; SparseLU tells them after the numbers only.
Offset factor_entries(const Llt& solver) { return solver.matrixL().nestedExpression().nonZeros(); }
Offset factor_entries(const Ldlt& solver) { return solver.matrixL().nestedExpression().nonZeros(); }
Offset factor_entries(const Lu& solver) { return static_cast<Offset>(solver.nnzL()) + solver.nnzU(); }

class EigenRival : public Rival {
 public:
  explicit EigenRival(const std::string& text) { const Variant none(text, ""); }

  [[nodiscard]] std::string name() const override { return "eigen"; }
  [[nodiscard]] std::string version() const override {
    return "Eigen " + std::to_string(EIGEN_WORLD_VERSION) + "." + std::to_string(EIGEN_MAJOR_VERSION) + "." +
           std::to_string(EIGEN_MINOR_VERSION) + ", SimplicialLLT / SimplicialLDLT with AMD, SparseLU with COLAMD";
  }

  AnalyzeReport analyze(const SystemView& a, Kind kind, int /*threads: it has one*/) override {
    matrix_ = CompressedMatrix(a, kind == Kind::lu ? Shape::full_by_column : Shape::lower_by_column, 0);
    pointers_ = matrix_.narrow_pointers();
    if (kind == Kind::llt)
      solver_ = std::make_unique<Llt>();
    else if (kind == Kind::ldlt)
      solver_ = std::make_unique<Ldlt>();
    else
      solver_ = std::make_unique<Lu>();
    AnalyzeReport report;
    const Sparse sparse = view();
    report.seconds = timed([&] { std::visit([&](auto& solver) { solver->analyzePattern(sparse); }, solver_); });
    return report;
  }
  FactorReport factorize(const SystemView& a) override { return refactorize(a.values); }
  FactorReport refactorize(std::span<const double> values) override {
    matrix_.fill(values);
    const Sparse sparse = view();
    FactorReport report;
    std::visit(
        [&](auto& solver) {
          report.seconds = timed([&] { solver->factorize(sparse); });
          if (solver->info() != Eigen::Success)
            throw Failure(Outcome::failed, "Eigen: a pivot is zero or not positive");
          report.nonzeros_factor = factor_entries(*solver);
        },
        solver_);
    if (const auto* ldlt = std::get_if<std::unique_ptr<Ldlt>>(&solver_)) {
      const auto& d = (*ldlt)->vectorD();
      report.inertia.positive = static_cast<Index>((d.array() > 0).count());
      report.inertia.negative = static_cast<Index>((d.array() < 0).count());
      report.inertia.zero = matrix_.size() - report.inertia.positive - report.inertia.negative;
    }
    return report;
  }
  SolveReport solve(std::span<const double> b, std::span<double> x, Index columns) override {
    const Eigen::Map<const Eigen::MatrixXd> rhs(b.data(), matrix_.size(), columns);
    Eigen::MatrixXd solution;
    SolveReport report;
    report.seconds = timed([&] { std::visit([&](auto& solver) { solution = solver->solve(rhs); }, solver_); });
    std::copy(solution.data(), solution.data() + x.size(), x.begin());
    report.refinement_steps = 0;
    return report;
  }
  [[nodiscard]] Offset overhead_bytes() const override { return matrix_.map_bytes(); }

 private:
  [[nodiscard]] Sparse view() const {
    return View(matrix_.size(), matrix_.size(), matrix_.nonzeros(), pointers_.data(), matrix_.indices.data(),
                matrix_.values.data());
  }

  CompressedMatrix matrix_;
  std::vector<std::int32_t> pointers_;
  std::variant<std::unique_ptr<Llt>, std::unique_ptr<Ldlt>, std::unique_ptr<Lu>> solver_;
};

}  // namespace
}  // namespace espalier::bench

ESPALIER_RIVAL_PLUGIN(espalier::bench::EigenRival)
