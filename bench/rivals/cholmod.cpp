/// \file
/// CHOLMOD of SuiteSparse: supernodal L L^T with METIS ordering. It stands here for comparison only.
#include <suitesparse/cholmod.h>

#include "rivals/compressed.hpp"
#include "rivals/rival.hpp"
#include "rivals/shared_library.hpp"
#include "rivals/variant.hpp"

namespace espalier::bench {
namespace {

class Cholmod : public Rival {
 public:
  explicit Cholmod(const std::string& text) : variant_(text, "amd best") {
    cholmod_start(&common_);
    common_.supernodal = CHOLMOD_SUPERNODAL;
    common_.final_ll = 1;
    common_.print = 0;
    if (variant_.has("best")) return;  // CHOLMOD's own rule: AMD first, METIS where AMD's fill is large
    common_.nmethods = 1;
    common_.method[0].ordering = variant_.has("amd") ? CHOLMOD_AMD : CHOLMOD_METIS;
    common_.postorder = 1;
  }
  ~Cholmod() override {
    drop();
    cholmod_finish(&common_);
  }

  [[nodiscard]] std::string name() const override { return "cholmod"; }
  [[nodiscard]] bool has_complex() const override { return true; }
  [[nodiscard]] std::string version() const override {
    int version[3];
    cholmod_version(version);
    return "CHOLMOD " + std::to_string(version[0]) + "." + std::to_string(version[1]) + "." +
           std::to_string(version[2]) + ", supernodal, " +
           (variant_.has("best")  ? "best of AMD and METIS"
            : variant_.has("amd") ? "AMD"
                                  : "METIS") +
           "; " + blas_in_use();
  }

  AnalyzeReport analyze(const SystemView& a, Kind kind, int /*threads: set through the environment*/) override {
    if (kind != Kind::llt)
      throw Failure(Outcome::not_offered, "CHOLMOD has no factorization with pivoting; only positive definite systems");
    drop();
    matrix_ = CompressedMatrix(a, Shape::lower_by_column, 0);
    pointers_ = matrix_.narrow_pointers();
    sparse_ = {};
    sparse_.nrow = sparse_.ncol = static_cast<std::size_t>(matrix_.size());
    sparse_.nzmax = matrix_.indices.size();
    sparse_.p = pointers_.data();
    sparse_.i = matrix_.indices.data();
    sparse_.x = matrix_.values.data();
    sparse_.stype = -1;
    sparse_.itype = CHOLMOD_INT;
    xtype_ = a.numbers == Numbers::real ? CHOLMOD_REAL : CHOLMOD_COMPLEX;
    sparse_.xtype = xtype_;
    sparse_.dtype = CHOLMOD_DOUBLE;
    sparse_.sorted = sparse_.packed = 1;
    AnalyzeReport report;
    report.seconds = timed([&] { factor_ = cholmod_analyze(&sparse_, &common_); });
    check("analysis");
    report.nonzeros_factor = static_cast<Offset>(common_.lnz);
    report.flops = common_.fl;
    return report;
  }
  FactorReport factorize(const SystemView& a) override { return refactorize(a.values); }
  FactorReport refactorize(std::span<const double> values) override {
    matrix_.fill(values);
    FactorReport report;
    report.seconds = timed([&] { cholmod_factorize(&sparse_, factor_, &common_); });
    check("factorization");
    report.inertia = {matrix_.size(), 0, 0};
    return report;
  }
  SolveReport solve(std::span<const double> b, std::span<double> x, Index columns) override {
    const auto rows = static_cast<std::size_t>(matrix_.size());
    cholmod_dense rhs{};
    rhs.nrow = rhs.d = rows;
    rhs.ncol = static_cast<std::size_t>(columns);
    rhs.nzmax = rows * rhs.ncol;
    std::vector<double> copy(b.begin(), b.end());
    rhs.x = copy.data();
    rhs.xtype = xtype_;
    rhs.dtype = CHOLMOD_DOUBLE;
    SolveReport report;
    report.seconds =
        timed([&] { cholmod_solve2(CHOLMOD_A, factor_, &rhs, nullptr, &solution_, nullptr, &y_, &e_, &common_); });
    check("solve");
    const auto* values = static_cast<const double*>(solution_->x);
    std::copy(values, values + x.size(), x.begin());
    report.refinement_steps = 0;
    return report;
  }
  [[nodiscard]] Offset overhead_bytes() const override { return matrix_.map_bytes(); }

 private:
  void check(const char* phase) {
    if (common_.status == CHOLMOD_OK) return;
    const std::string where = std::string("CHOLMOD ") + phase + ": ";
    switch (common_.status) {
      case CHOLMOD_OUT_OF_MEMORY:
        throw Failure(Outcome::out_of_memory, where + "out of memory");
      case CHOLMOD_NOT_POSDEF:
        throw Failure(Outcome::failed,
                      where + "not positive definite at column " + std::to_string(factor_ ? factor_->minor : 0));
      case CHOLMOD_TOO_LARGE:
        throw Failure(Outcome::not_offered, where + "the factor passes 32-bit integers");
      default:
        throw Failure(Outcome::failed, where + "status " + std::to_string(common_.status));
    }
  }
  void drop() {
    cholmod_free_dense(&solution_, &common_);
    cholmod_free_dense(&y_, &common_);
    cholmod_free_dense(&e_, &common_);
    cholmod_free_factor(&factor_, &common_);
  }

  Variant variant_;
  cholmod_common common_{};
  CompressedMatrix matrix_;
  std::vector<std::int32_t> pointers_;
  cholmod_sparse sparse_{};
  int xtype_ = CHOLMOD_REAL;
  cholmod_factor* factor_ = nullptr;
  cholmod_dense* solution_ = nullptr;
  cholmod_dense* y_ = nullptr;
  cholmod_dense* e_ = nullptr;
};

}  // namespace
}  // namespace espalier::bench

ESPALIER_RIVAL_PLUGIN(espalier::bench::Cholmod)
