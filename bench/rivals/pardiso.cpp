/// \file
/// Intel MKL PARDISO, loaded at run time and set up as its users run it: pardisoinit, parallel nested dissection
/// (iparm(2) = 3), scaling and weighted matching on for indefinite and unsymmetric systems (iparm(11) = iparm(13) = 1).
#include <array>
#include <memory>

#include "rivals/compressed.hpp"
#include "rivals/rival.hpp"
#include "rivals/shared_library.hpp"
#include "rivals/variant.hpp"

namespace espalier::bench {
namespace {

/// The 64-bit interface serves systems whose factor may pass 2^31 entries: with three unknowns per node of a 3-D mesh
/// nnz(L) is 1.9e9 at 0.8 million unknowns (elasticity 64^3).
constexpr Index kWideFrom = 900'000;

/// MKL's layers. The GNU thread layer needs nothing that is not on every Linux machine.
struct Mkl {
  SharedLibrary gomp{{"libgomp.so.1"}, SharedLibrary::Scope::global};
  SharedLibrary core{{"libmkl_core.so.3", "libmkl_core.so.2"}, SharedLibrary::Scope::global};
  SharedLibrary threads{{"libmkl_gnu_thread.so.3", "libmkl_gnu_thread.so.2"}, SharedLibrary::Scope::global};
  SharedLibrary interface { {"libmkl_intel_lp64.so.3", "libmkl_intel_lp64.so.2"}, SharedLibrary::Scope::global };
};

template <typename Int>
using PardisoCall = void (*)(void* pt, const Int* maxfct, const Int* mnum, const Int* mtype, const Int* phase,
                             const Int* n, const void* a, const Int* ia, const Int* ja, Int* perm, const Int* nrhs,
                             Int* iparm, const Int* msglvl, void* b, void* x, Int* error);

/// MKL's number for the sort of matrix. `structural`: of an lu, that the pattern is symmetric.
int matrix_type(Numbers numbers, Kind kind, bool structural) {
  if (numbers == Numbers::real) return kind == Kind::llt ? 2 : kind == Kind::ldlt ? -2 : structural ? 1 : 11;
  if (kind == Kind::lu) return structural ? 3 : 13;
  return numbers == Numbers::complex ? 6 : kind == Kind::llt ? 4 : -4;
}

/// What the error numbers of the manual mean.
Failure pardiso_failure(long long error, const char* phase) {
  constexpr std::array<const char*, 12> kMeaning = {"input inconsistent",
                                                    "not enough memory",
                                                    "reordering problem",
                                                    "zero pivot, numerical factorization stopped",
                                                    "unclassified internal error",
                                                    "reordering failed",
                                                    "diagonal matrix is singular",
                                                    "32-bit integer overflow",
                                                    "not enough memory for out-of-core",
                                                    "error opening out-of-core files",
                                                    "read/write error of out-of-core files",
                                                    "pardiso_64 called from a 32-bit library"};
  const bool known = error <= -1 && error >= -static_cast<long long>(kMeaning.size());
  return Failure(error == -2 ? Outcome::out_of_memory : Outcome::failed,
                 std::string("PARDISO ") + phase + ": error " + std::to_string(error) +
                     (known ? std::string(", ") + kMeaning[static_cast<std::size_t>(-error - 1)] : ""));
}

/// One analyzed system. Int is int (pardiso) or long long (pardiso_64).
template <typename Int>
class System {
 public:
  System(const Mkl& mkl, const SystemView& a, Kind kind, bool structural)
      : call_(mkl.interface.function<PardisoCall<Int>>(sizeof(Int) == 4 ? "pardiso" : "pardiso_64")),
        mtype_(matrix_type(a.numbers, kind, structural)),
        matrix_(a, kind == Kind::lu ? Shape::full_by_row : Shape::upper_by_row, 1),
        n_(matrix_.size()) {
    if constexpr (sizeof(Int) == 4) {
      rows_ = matrix_.narrow_pointers();
    } else {
      rows_.assign(matrix_.pointers.begin(), matrix_.pointers.end());
      wide_columns_.assign(matrix_.indices.begin(), matrix_.indices.end());
    }
    std::array<int, 64> defaults{};
    const int mtype = static_cast<int>(mtype_);
    mkl.interface.function<void (*)(void*, const int*, int*)>("pardisoinit")(handle_.data(), &mtype, defaults.data());
    std::copy(defaults.begin(), defaults.end(), iparm_.begin());
    iparm_[0] = 1;                                       // the values below count, not the defaults
    iparm_[1] = 3;                                       // parallel nested dissection
    iparm_[17] = -1;                                     // report nnz(L)
    iparm_[34] = 0;                                      // indices from 1
    if (kind != Kind::llt) iparm_[10] = iparm_[12] = 1;  // scaling and weighted matching
  }
  System(const System&) = delete;
  System& operator=(const System&) = delete;
  ~System() {
    Int error = 0;
    run(-1, nullptr, nullptr, 1, error);
  }

  void phase(Int number, const char* name, double* b = nullptr, double* x = nullptr, Int columns = 1) {
    Int error = 0;
    run(number, b, x, columns, error);
    if (error != 0) throw pardiso_failure(error, name);
  }
  [[nodiscard]] Int parameter(int fortran_index) const { return iparm_[static_cast<std::size_t>(fortran_index - 1)]; }
  CompressedMatrix& matrix() { return matrix_; }

 private:
  void run(Int number, double* b, double* x, Int columns, Int& error) {
    const Int one = 1, silent = 0;
    const Int* indices = nullptr;
    if constexpr (sizeof(Int) == 4)
      indices = matrix_.indices.data();
    else
      indices = wide_columns_.data();
    call_(handle_.data(), &one, &one, &mtype_, &number, &n_, matrix_.values.data(), rows_.data(), indices, nullptr,
          &columns, iparm_.data(), &silent, b, x, &error);
  }

  PardisoCall<Int> call_;
  Int mtype_;
  CompressedMatrix matrix_;
  Int n_;
  std::vector<Int> rows_, wide_columns_;
  std::array<void*, 64> handle_{};
  std::array<Int, 64> iparm_{};
};

template <typename Int>
FactorReport factor(System<Int>& system, bool symmetric) {
  FactorReport report;
  report.seconds = timed([&] { system.phase(22, "factorization"); });
  report.nonzeros_factor = system.parameter(18) > 0 ? static_cast<Offset>(system.parameter(18)) : -1;
  report.perturbed = static_cast<Index>(system.parameter(14));
  if (symmetric) {
    report.inertia.positive = static_cast<Index>(system.parameter(22));
    report.inertia.negative = static_cast<Index>(system.parameter(23));
    report.inertia.zero = system.matrix().size() - report.inertia.positive - report.inertia.negative;
  }
  return report;
}

class Pardiso : public Rival {
  // Stands first because its return type is deduced.
  template <typename Use>
  auto with_system(Use&& use) {
    return narrow_ ? use(*narrow_) : use(*wide_);
  }

 public:
  explicit Pardiso(const std::string& text) : variant_(text, "wide structural") {
    mkl_.interface.function<void (*)(int)>("MKL_Set_Dynamic")(0);
  }

  [[nodiscard]] std::string name() const override { return "pardiso"; }
  [[nodiscard]] bool has_complex() const override { return true; }
  [[nodiscard]] std::string version() const override {
    std::array<char, 256> text{};
    mkl_.interface.function<void (*)(char*, int)>("MKL_Get_Version_String")(text.data(), 255);
    std::string version(text.data());
    version.erase(version.find_last_not_of(' ') + 1);
    return version + "; iparm(2)=3, iparm(11)=iparm(13)=1 unless positive definite";
  }

  AnalyzeReport analyze(const SystemView& a, Kind kind, int threads) override {
    mkl_.interface.function<void (*)(int)>("MKL_Set_Num_Threads")(threads);
    symmetric_ = kind == Kind::ldlt && a.numbers == Numbers::real;  // it counts none of Hermitian matrices
    narrow_.reset(), wide_.reset();
    const bool wide = variant_.has("wide") || a.rows >= kWideFrom;
    return wide ? analyze_with(wide_, a, kind) : analyze_with(narrow_, a, kind);
  }
  FactorReport factorize(const SystemView& a) override { return refactorize(a.values); }
  FactorReport refactorize(std::span<const double> values) override {
    return with_system([&](auto& system) {
      system.matrix().fill(values);
      return factor(system, symmetric_);
    });
  }
  SolveReport solve(std::span<const double> b, std::span<double> x, Index columns) override {
    std::vector<double> rhs(b.begin(), b.end());
    return with_system([&](auto& system) {
      SolveReport report;
      report.seconds = timed([&] { system.phase(33, "solve", rhs.data(), x.data(), columns); });
      report.refinement_steps = static_cast<int>(system.parameter(7));
      return report;
    });
  }
  [[nodiscard]] Offset overhead_bytes() const override {
    return narrow_ ? narrow_->matrix().map_bytes() : wide_ ? wide_->matrix().map_bytes() : 0;
  }

 private:
  template <typename Int>
  AnalyzeReport analyze_with(std::unique_ptr<System<Int>>& system, const SystemView& a, Kind kind) {
    system = std::make_unique<System<Int>>(mkl_, a, kind, variant_.has("structural"));
    AnalyzeReport report;
    report.seconds = timed([&] { system->phase(11, "analysis"); });
    report.nonzeros_factor = system->parameter(18) > 0 ? static_cast<Offset>(system->parameter(18)) : -1;
    return report;
  }
  Variant variant_;
  Mkl mkl_;
  bool symmetric_ = false;  ///< with an inertia
  std::unique_ptr<System<int>> narrow_;
  std::unique_ptr<System<long long>> wide_;
};

}  // namespace
}  // namespace espalier::bench

ESPALIER_RIVAL_PLUGIN(espalier::bench::Pardiso)
