/// \file
/// NVIDIA cuDSS, loaded at run time: plain, hybrid-memory, deterministic and several-GPU modes.
///
/// Variants: hybrid (its own choice of device memory), hybrid=MIB (limit), hybrid=min (the least it accepts),
/// deterministic, gpus=N, matching=none|auto|product (product, with its scaling, is set for indefinite systems).
/// Values, right-hand sides and solutions live in device memory while the clock runs; the device is idle on both sides.
#include <array>
#include <cstring>
#include <memory>
#include <numeric>

#include "rivals/compressed.hpp"
#include "rivals/cudss_api.hpp"
#include "rivals/rival.hpp"
#include "rivals/variant.hpp"

namespace espalier::bench {
namespace {

using namespace cudss;

int matrix_type(Numbers numbers, Kind kind) {
  if (kind == Kind::lu) return kGeneral;
  if (numbers == Numbers::hermitian) return kind == Kind::llt ? kHermitianDefinite : kHermitian;
  return kind == Kind::llt ? kPositiveDefinite : kSymmetric;
}

/// The CUDA runtime with at least `wanted` devices behind it.
class Machine {
 public:
  explicit Machine(int wanted) {
    int count = 0;
    const int error = cuda.get_device_count(&count);
    if (error != 0) throw Failure(Outcome::missing, std::string("no GPU here: ") + cuda.error_string(error));
    if (count < wanted)
      throw Failure(Outcome::missing, std::to_string(wanted) + " GPUs wanted, " + std::to_string(count) + " here");
    check_cuda(cuda, cuda.set_device(0), "cudaSetDevice");
    check_cuda(cuda, cuda.free(nullptr), "cudaFree");  // creates the context, outside of every clock
  }
  Cuda cuda;
};

/// Handle, configuration and one analyzed system.
class System {
 public:
  System(const Machine& machine, const Api& api, const Variant& variant, const SystemView& a, Kind kind, int threads)
      : machine_(machine),
        api_(api),
        devices_(static_cast<int>(variant.number("gpus", 1))),
        number_(a.numbers == Numbers::real ? kReal64 : kComplex64),
        host_(a, kind == Kind::lu ? Shape::full_by_row : Shape::upper_by_row, 0),
        rows_(machine.cuda, host_.pointers.size()),
        columns_(machine.cuda, host_.indices.size()),
        values_(machine.cuda, host_.values.size()) {
    create_handle();
    check_cudss(api_.config_create(&config_), "cudssConfigCreate");
    configure(variant, kind, threads);
    check_cudss(api_.data_create(handle_, &data_), "cudssDataCreate");
    rows_.upload(host_.narrow_pointers().data());
    columns_.upload(host_.indices.data());
    values_.upload(host_.values.data());
    const int type = matrix_type(a.numbers, kind);
    check_cudss(api_.create_csr(&matrix_, host_.size(), host_.size(), host_.nonzeros(), rows_.get(), nullptr,
                                columns_.get(), values_.get(), kInteger32, kInteger32, number_, type,
                                kind == Kind::lu ? kFull : kUpper, kBaseZero),
                "cudssMatrixCreateCsr");
  }
  System(const System&) = delete;
  System& operator=(const System&) = delete;
  ~System() {
    if (matrix_ != nullptr) api_.matrix_destroy(matrix_);
    if (data_ != nullptr) api_.data_destroy(handle_, data_);
    if (config_ != nullptr) api_.config_destroy(config_);
    if (handle_ != nullptr) api_.destroy(handle_);
  }

  /// Sets the device-memory limit of hybrid mode to the least that cuDSS accepts. @pre analysis is done
  void limit_to_least_memory() {
    std::int64_t least = 0;
    if (!get(kHybridDeviceMemoryMin, &least, sizeof least))
      throw Failure(Outcome::failed, "cuDSS does not tell its least device memory");
    set(kHybridDeviceMemoryLimit, least, "HYBRID_DEVICE_MEMORY_LIMIT");
  }
  void upload_values(std::span<const double> values) {
    host_.fill(values);
    values_.upload(host_.values.data());
  }
  /// Runs a phase; x and b are dense matrices of device memory (for phases without them: dummies of one column).
  double run(int phase, const char* name, Matrix x, Matrix b) {
    check_cuda(machine_.cuda, machine_.cuda.synchronize(), "cudaDeviceSynchronize");
    int status = kSuccess, error = 0;
    const double seconds = timed([&] {
      status = api_.execute(handle_, phase, config_, data_, matrix_, x, b);
      error = machine_.cuda.synchronize();
    });
    check_cudss(status, name);
    check_cuda(machine_.cuda, error, name);
    return seconds;
  }
  /// Reads `bytes` of result `param`; false where cuDSS does not tell.
  bool get(int param, void* value, std::size_t bytes) const {
    std::size_t written = 0;
    return api_.data_get(handle_, data_, param, value, bytes, &written) == kSuccess;
  }
  /// A dense matrix around device memory, destroyed with the returned pointer.
  auto dense(void* values, Index columns) const {
    Matrix matrix = nullptr;
    check_cudss(api_.create_dense(&matrix, host_.size(), columns, host_.size(), values, number_, kColumnMajor),
                "cudssMatrixCreateDn");
    return std::unique_ptr<std::remove_pointer_t<Matrix>, int (*)(Matrix)>(matrix, api_.matrix_destroy);
  }
  /// cuDSS's own estimate of the peak of device memory; -1 where it does not tell. (What is free on the device would
  /// count the other contestants that hold memory there at the same time.)
  [[nodiscard]] Offset device_bytes() const {
    std::array<std::int64_t, 16> estimates{};
    return get(kMemoryEstimates, estimates.data(), sizeof estimates) ? Offset{estimates[1]} : Offset{-1};
  }
  [[nodiscard]] const CompressedMatrix& host() const { return host_; }

 private:
  void create_handle() {
    std::vector<int> indices(static_cast<std::size_t>(devices_));
    std::iota(indices.begin(), indices.end(), 0);
    if (devices_ == 1)
      check_cudss(api_.create(&handle_), "cudssCreate");
    else
      check_cudss(api_.create_mg(&handle_, devices_, indices.data()), "cudssCreateMg");
  }
  template <typename T>
  void set(int param, const T& value, const char* name) {
    check_cudss(api_.config_set(config_, param, &value, sizeof value), name);
  }
  void configure(const Variant& variant, Kind kind, int threads) {
    const SharedLibrary layer({"libcudss_mtlayer_gomp.so.1", "libcudss_mtlayer_gomp.so.0"},
                              SharedLibrary::Scope::global);
    check_cudss(api_.set_threading_layer(handle_, layer.path().c_str()), "cudssSetThreadingLayer");
    set(kHostThreads, threads, "HOST_NTHREADS");
    if (devices_ > 1) {
      std::vector<int> indices(static_cast<std::size_t>(devices_));
      std::iota(indices.begin(), indices.end(), 0);
      set(kDeviceCount, devices_, "DEVICE_COUNT");
      check_cudss(api_.config_set(config_, kDeviceIndices, indices.data(), indices.size() * sizeof(int)),
                  "DEVICE_INDICES");
    }
    if (variant.has("deterministic")) set(kDeterministicMode, 1, "DETERMINISTIC_MODE");
    if (variant.has("hybrid")) {
      set(kHybridMemoryMode, 1, "HYBRID_MEMORY_MODE");
      if (variant.text("hybrid") != "min" && !variant.text("hybrid").empty())
        set(kHybridDeviceMemoryLimit, std::int64_t{variant.number("hybrid", 0)} << 20, "HYBRID_DEVICE_MEMORY_LIMIT");
    }
    const std::string matching = variant.text("matching", kind == Kind::ldlt ? "product" : "");
    if (!matching.empty())
      set(kMatchingAlg,
          matching == "none"   ? kNoMatching
          : matching == "auto" ? kMatchingAuto
                               : kMaxDiagProduct,
          "MATCHING_ALG");
  }

  const Machine& machine_;
  const Api& api_;
  int devices_, number_;
  CompressedMatrix host_;
  DeviceArray<std::int32_t> rows_, columns_;
  DeviceArray<double> values_;
  Handle handle_ = nullptr;
  Config config_ = nullptr;
  Data data_ = nullptr;
  Matrix matrix_ = nullptr;
};

/// A figure that the library stores in 8 bytes, as an integer or as a double: the bits of every double from 1 on, read
/// as an integer, are above 4.6e18, and those of every count of ours, read as a double, are below 1.
double figure(const System& system, int param) {
  std::int64_t bits = 0;
  if (!system.get(param, &bits, sizeof bits)) return -1;
  double value = 0;
  std::memcpy(&value, &bits, sizeof value);
  return value >= 1 ? value : static_cast<double>(bits);
}

class Cudss : public Rival {
 public:
  explicit Cudss(const std::string& text)
      : text_(text),
        variant_(text, "hybrid deterministic gpus matching"),
        machine_(static_cast<int>(variant_.number("gpus", 1))) {}

  [[nodiscard]] std::string name() const override { return "cudss"; }
  [[nodiscard]] bool has_complex() const override { return true; }
  [[nodiscard]] std::string version() const override {
    std::array<int, 3> version{};
    for (int k = 0; k < 3; ++k) api_.get_property(k, &version[static_cast<std::size_t>(k)]);
    return "cuDSS " + std::to_string(version[0]) + "." + std::to_string(version[1]) + "." + std::to_string(version[2]) +
           ", gomp layer" + (text_.empty() ? "" : "; " + text_) +
           "; matching by diagonal product for indefinite systems";
  }

  AnalyzeReport analyze(const SystemView& a, Kind kind, int threads) override {
    symmetric_ = kind != Kind::lu && a.numbers != Numbers::complex;
    system_.reset();
    system_ = std::make_unique<System>(machine_, api_, variant_, a, kind, threads);
    AnalyzeReport report;
    report.seconds = run_without_vectors(kAnalysis, "analysis");
    report.nonzeros_factor = static_cast<Offset>(figure(*system_, kFactorNonzeros));
    report.flops = figure(*system_, kFlops);
    if (variant_.text("hybrid") == "min") system_->limit_to_least_memory();
    return report;
  }
  FactorReport factorize(const SystemView& a) override { return numbers(a.values, kFactorization, "factorization"); }
  FactorReport refactorize(std::span<const double> values) override {
    return numbers(values, kRefactorization, "refactorization");
  }
  SolveReport solve(std::span<const double> b, std::span<double> x, Index columns) override {
    DeviceArray<double> rhs(machine_.cuda, b.size()), solution(machine_.cuda, x.size());
    rhs.upload(b.data());
    const auto dense_b = system_->dense(rhs.get(), columns), dense_x = system_->dense(solution.get(), columns);
    SolveReport report;
    report.seconds = system_->run(kSolve, "solve", dense_x.get(), dense_b.get());
    int steps = -1;
    report.refinement_steps = system_->get(kRefinementSteps, &steps, sizeof steps) ? steps : -1;
    solution.download(x.data());
    return report;
  }
  [[nodiscard]] Offset overhead_bytes() const override { return system_ ? system_->host().map_bytes() : 0; }

 private:
  double run_without_vectors(int phase, const char* name) {
    DeviceArray<double> dummy(machine_.cuda, 2 * static_cast<std::size_t>(system_->host().size()));
    const auto b = system_->dense(dummy.get(), 1), x = system_->dense(dummy.get(), 1);
    return system_->run(phase, name, x.get(), b.get());
  }
  FactorReport numbers(std::span<const double> values, int phase, const char* name) {
    system_->upload_values(values);
    FactorReport report;
    report.seconds = run_without_vectors(phase, name);
    int info = 0;
    if (system_->get(kInfo, &info, sizeof info) && info != 0)
      throw Failure(Outcome::failed, std::string("cuDSS ") + name + ": info " + std::to_string(info));
    int perturbed = -1;
    report.perturbed = system_->get(kPivots, &perturbed, sizeof perturbed) ? perturbed : -1;
    std::array<int, 2> signs{};
    if (symmetric_ && system_->get(kInertia, signs.data(), sizeof signs))
      report.inertia = {signs[0], signs[1], system_->host().size() - signs[0] - signs[1]};
    report.device_bytes = system_->device_bytes();
    return report;
  }

  std::string text_;
  Variant variant_;
  Api api_;  // before the machine: a missing library is told even where no GPU is
  Machine machine_;
  bool symmetric_ = false;  ///< with an inertia
  std::unique_ptr<System> system_;
};

}  // namespace
}  // namespace espalier::bench

ESPALIER_RIVAL_PLUGIN(espalier::bench::Cudss)
