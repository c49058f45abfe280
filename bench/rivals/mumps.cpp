/// \file
/// MUMPS, sequential build (its threads are those of the BLAS). It stands here for comparison only.
#include <dmumps_c.h>
#include <metis.h>
#include <zmumps_c.h>

#include <memory>

#include "rivals/compressed.hpp"
#include "rivals/rival.hpp"
#include "rivals/shared_library.hpp"
#include "rivals/variant.hpp"

namespace espalier::bench {
namespace {

constexpr int kUseCommWorld = -987654;  ///< the communicator number that MUMPS reads as MPI_COMM_WORLD
/// Orderings by the numbers of ICNTL(7).
constexpr int kPermutationGiven = 1, kMetis = 5, kAutomatic = 7;

/// One MUMPS instance of either sort of numbers.
class Instance {
 public:
  Instance() = default;
  Instance(const Instance&) = delete;
  Instance& operator=(const Instance&) = delete;
  virtual ~Instance() = default;

  virtual int& icntl(int fortran_index) = 0;
  [[nodiscard]] virtual int infog(int fortran_index) const = 0;
  [[nodiscard]] virtual double rinfog(int fortran_index) const = 0;
  /// Runs a job and returns INFOG(1); negative numbers are errors.
  virtual int try_job(int number) = 0;
  /// Values of `matrix` and indices of its columns, one for each entry; both stay in use.
  virtual void set_matrix(CompressedMatrix& matrix, MUMPS_INT* columns) = 0;
  virtual void set_right_hand_sides(double* b, MUMPS_INT columns) = 0;
  virtual void set_permutation(MUMPS_INT* positions) = 0;

  /// Counts above 2^31 are told in millions, with a minus sign.
  [[nodiscard]] Offset count(int fortran_index) const {
    const Offset value = infog(fortran_index);
    return value < 0 ? -value * 1'000'000 : value;
  }
  void job(int number, const char* phase) {
    const int error = try_job(number);
    if (error >= 0) return;
    const bool memory = error == -7 || error == -13 || error == -19 || error == -9 || error == -8;
    const std::string meaning = error == -10 || error == -6 ? ", the matrix is singular" : memory ? ", memory" : "";
    throw Failure(memory ? Outcome::out_of_memory : Outcome::failed,
                  std::string("MUMPS ") + phase + ": INFOG(1)=" + std::to_string(error) +
                      ", INFOG(2)=" + std::to_string(infog(2)) + meaning);
  }
};

/// The life of an instance of dmumps_c or zmumps_c: job -1 in the constructor, job -2 in the destructor.
template <typename Data, void (*call)(Data*)>
class InstanceOf : public Instance {
 public:
  explicit InstanceOf(int sym) {
    data_.sym = sym;
    data_.par = 1;
    data_.comm_fortran = kUseCommWorld;
    job(-1, "start");
    for (int k = 1; k <= 4; ++k) data_.icntl[k - 1] = k == 4 ? 0 : -1;  // silent
    data_.icntl[28 - 1] = 1;                                            // sequential analysis
  }
  ~InstanceOf() override {
    data_.job = -2;
    call(&data_);
  }

  int& icntl(int fortran_index) override { return data_.icntl[fortran_index - 1]; }
  [[nodiscard]] int infog(int fortran_index) const override { return data_.infog[fortran_index - 1]; }
  [[nodiscard]] double rinfog(int fortran_index) const override { return data_.rinfog[fortran_index - 1]; }
  int try_job(int number) override {
    data_.job = number;
    call(&data_);
    return data_.infog[0];
  }
  void set_matrix(CompressedMatrix& matrix, MUMPS_INT* columns) override {
    data_.n = matrix.size();
    data_.nnz = matrix.nonzeros();
    data_.irn = matrix.indices.data();
    data_.jcn = columns;
    data_.a = reinterpret_cast<decltype(data_.a)>(matrix.values.data());
  }
  void set_right_hand_sides(double* b, MUMPS_INT columns) override {
    data_.rhs = reinterpret_cast<decltype(data_.rhs)>(b);
    data_.nrhs = columns;
    data_.lrhs = data_.n;
  }
  void set_permutation(MUMPS_INT* positions) override { data_.perm_in = positions; }

 private:
  Data data_{};
};
using RealInstance = InstanceOf<DMUMPS_STRUC_C, dmumps_c>;
using ComplexInstance = InstanceOf<ZMUMPS_STRUC_C, zmumps_c>;

class Mumps : public Rival {
 public:
  explicit Mumps(const std::string& text) : variant_(text, "metis auto ordering") {}

  [[nodiscard]] std::string name() const override { return "mumps"; }
  [[nodiscard]] bool has_complex() const override { return true; }
  [[nodiscard]] std::string version() const override {
    const std::string ordering = own_metis() ? "METIS handed in as permutation"
                                             : "ICNTL(7)=" + std::to_string(variant_.number("ordering", kAutomatic));
    return std::string("MUMPS ") + MUMPS_VERSION + " sequential, " + ordering + "; " + blas_in_use();
  }

  AnalyzeReport analyze(const SystemView& a, Kind kind, int /*threads: set through the environment*/) override {
    // MUMPS has no factorization of Hermitian matrices: they are general ones to it.
    symmetric_ = kind != Kind::lu && a.numbers != Numbers::hermitian;
    const int sym = !symmetric_ ? 0 : kind == Kind::llt ? 1 : 2;
    if (a.numbers == Numbers::real)
      instance_ = std::make_unique<RealInstance>(sym);
    else
      instance_ = std::make_unique<ComplexInstance>(sym);
    matrix_ = CompressedMatrix(a, symmetric_ ? Shape::lower_by_column : Shape::full_by_column, 1);
    columns_.resize(matrix_.indices.size());
    for (Index column = 0; column < matrix_.size(); ++column)
      std::fill(columns_.begin() + matrix_.pointers[column] - 1, columns_.begin() + matrix_.pointers[column + 1] - 1,
                column + 1);
    instance_->set_matrix(matrix_, columns_.data());
    inertia_ = symmetric_ && a.numbers == Numbers::real;
    instance_->icntl(7) = static_cast<int>(variant_.number("ordering", kAutomatic));
    AnalyzeReport report;
    report.seconds = timed([&] {
      if (own_metis()) order_by_metis(a);
      instance_->job(1, "analysis");
    });
    report.nonzeros_factor = instance_->count(20);
    report.flops = instance_->rinfog(1);
    return report;
  }
  /// Enlarges the work space until the factorization fits: the estimate of the analysis knows no delayed pivots.
  FactorReport factorize(const SystemView& a) override {
    constexpr int kWorkSpaceTooSmall[] = {-8, -9, -14, -15, -17, -20};
    matrix_.fill(a.values);
    for (int attempt = 0; attempt < 5; ++attempt) {
      const FactorReport report = numbers([&] { instance_->try_job(2); });
      const int error = instance_->infog(1);
      if (error >= 0) return report;
      if (std::find(std::begin(kWorkSpaceTooSmall), std::end(kWorkSpaceTooSmall), error) ==
          std::end(kWorkSpaceTooSmall))
        break;
      instance_->icntl(14) = instance_->icntl(14) * 2 + 20;  // per cent added to the estimate
    }
    return numbers([&] { instance_->job(2, "factorization"); });
  }
  FactorReport refactorize(std::span<const double> values) override {
    matrix_.fill(values);
    return numbers([&] { instance_->job(2, "factorization"); });
  }
  SolveReport solve(std::span<const double> b, std::span<double> x, Index columns) override {
    std::copy(b.begin(), b.end(), x.begin());
    instance_->set_right_hand_sides(x.data(), columns);
    SolveReport report;
    report.seconds = timed([&] { instance_->job(3, "solve"); });
    report.refinement_steps = 0;
    return report;
  }
  [[nodiscard]] Offset overhead_bytes() const override { return matrix_.map_bytes(); }

 private:
  [[nodiscard]] bool own_metis() const { return variant_.has("metis"); }

  template <typename Call>
  FactorReport numbers(Call&& call) {
    FactorReport report;
    report.seconds = timed(call);
    report.nonzeros_factor = instance_->count(29);
    report.flops = instance_->rinfog(3);
    if (inertia_) {
      report.inertia.negative = instance_->infog(12);
      report.inertia.zero = instance_->infog(28);
      report.inertia.positive = matrix_.size() - report.inertia.negative - report.inertia.zero;
    }
    report.perturbed = instance_->infog(25);
    return report;
  }

  /// Debian builds MUMPS without METIS, so METIS_NodeND runs here and its order is handed in (ICNTL(7) = 1).
  void order_by_metis(const MatrixView& a) {
    const MatrixView pattern{a.rows,    a.cols, a.col_ptr,
                             a.row_ind, {},     a.symmetric() ? a.storage : Storage::symmetric_both};
    const CompressedMatrix full(pattern, Shape::full_by_column, 0);
    std::vector<idx_t> start{0}, neighbours;
    for (Index column = 0; column < full.size(); ++column) {
      for (Offset k = full.pointers[column]; k < full.pointers[column + 1]; ++k)
        if (full.indices[k] != column) neighbours.push_back(full.indices[k]);
      start.push_back(static_cast<idx_t>(neighbours.size()));
    }
    idx_t vertices = full.size();
    std::vector<idx_t> order(static_cast<std::size_t>(vertices));
    permutation_.resize(order.size());
    if (METIS_NodeND(&vertices, start.data(), neighbours.data(), nullptr, nullptr, order.data(), permutation_.data()) !=
        METIS_OK)
      throw Failure(Outcome::failed, "METIS_NodeND failed");
    for (idx_t& position : permutation_) ++position;
    instance_->set_permutation(permutation_.data());
    instance_->icntl(7) = kPermutationGiven;
  }

  Variant variant_;
  std::unique_ptr<Instance> instance_;
  CompressedMatrix matrix_;
  std::vector<MUMPS_INT> columns_;
  std::vector<idx_t> permutation_;
  bool symmetric_ = false;  ///< one triangle is given
  bool inertia_ = false;
};

}  // namespace
}  // namespace espalier::bench

ESPALIER_RIVAL_PLUGIN(espalier::bench::Mumps)
