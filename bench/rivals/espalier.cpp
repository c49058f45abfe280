/// \file
/// Espalier behind the same interface, through its public header (sizes are read by the library's own parser).
#include <algorithm>
#include <cstdlib>
#include <memory>
#include <sstream>
#include <vector>

#include "espalier/complex_solver.hpp"
#include "rivals/cuda_runtime.hpp"
#include "rivals/rival.hpp"
#include "rivals/variant.hpp"
#include "solver/options/option_text.hpp"

namespace espalier::bench {
namespace {

/// Passes a status of the library on as a failure.
void check(const Status& status) {
  if (status.ok()) return;
  switch (status.code) {
    case StatusCode::out_of_memory:
      throw Failure(Outcome::out_of_memory, status.message);
    case StatusCode::device_error:
      throw Failure(Outcome::missing, status.message);
    case StatusCode::accuracy_not_reached:
      throw Failure(Outcome::wrong_answer, status.message);
    default:
      throw Failure(Outcome::failed, status.message);
  }
}

std::span<const std::complex<double>> as_complex(std::span<const double> v) {
  return {base::as_complex(v.data()), v.size() / 2};
}
std::span<std::complex<double>> as_complex(std::span<double> v) { return {base::as_complex(v.data()), v.size() / 2}; }
ComplexMatrixView complex_view(const SystemView& a) {
  return {a.rows, a.cols, a.col_ptr, a.row_ind, as_complex(a.values), a.storage};
}

Precision precision_named(const std::string& word) {
  if (word == "fp64") return Precision::fp64;
  if (word == "fp32") return Precision::fp32;
  if (word == "mixed") return Precision::mixed;
  if (word == "auto") return Precision::automatic;
  throw Failure(Outcome::failed, "precision=" + word + ": known are fp64, fp32, mixed, auto");
}

class EspalierRival : public Rival {
 public:
  explicit EspalierRival(const std::string& text)
      : text_(text),
        variant_(
            text,
            "device precision refine block memory hostmemory nomatching trace subtrees nosteal alonetop resident") {
    options_.device = variant_.text("device", "cpu");
    options_.precision = precision_named(variant_.text("precision", "fp64"));
    options_.refinement_steps = static_cast<int>(variant_.number("refine", options_.refinement_steps));
    options_.max_block_size = static_cast<Index>(variant_.number("block", 0));
    options_.device_memory_bytes = bytes_of("memory");
    options_.host_memory_bytes = bytes_of("hostmemory");
    options_.sharing.additional_subtrees = static_cast<double>(variant_.number("subtrees", 1));
    options_.sharing.stealing = !variant_.has("nosteal");
    options_.sharing.shared_top = !variant_.has("alonetop");
    options_.record_timeline = variant_.has("trace");
    options_.matching = !variant_.has("nomatching");
    if (variant_.has("resident") && options_.device.rfind("gpu", 0) != 0)
      throw Failure(Outcome::failed, "resident needs device=gpu:..., not " + options_.device);
    if (options_.device.rfind("gpu", 0) == 0) open_gpus();
  }

  [[nodiscard]] std::string name() const override { return "espalier"; }
  [[nodiscard]] bool has_complex() const override { return true; }
  [[nodiscard]] std::string version() const override {
    return "Espalier, device " + options_.device + (text_.empty() ? "" : "; " + text_);
  }

  AnalyzeReport analyze(const SystemView& a, Kind kind, int threads) override {
    options_.kind = kind;
    options_.threads = threads;
    solver_.reset(), complex_.reset();
    if (a.numbers == Numbers::real)
      solver_ = std::make_unique<Solver>(options_);
    else if (!variant_.has("resident"))
      complex_ = std::make_unique<ComplexSolver>(options_);
    else
      throw Failure(Outcome::not_offered, "resident takes real systems only");
    AnalysisResult result;
    AnalyzeReport report;
    report.seconds =
        timed([&] { result = complex_ ? complex_->analyze(complex_view(a)) : solver_->analyze(MatrixView(a)); });
    check(result.status);
    report.nonzeros_factor = result.nonzeros_factor;
    report.flops = result.flops;
    report.predicted_bytes = result.predicted_bytes;
    return report;
  }
  FactorReport factorize(const SystemView& a) override {
    if (complex_) return numbers([&] { return complex_->factorize(complex_view(a)); });
    return numbers([&] { return solver_->factorize(MatrixView(a)); });
  }
  FactorReport refactorize(std::span<const double> values) override {
    if (complex_) return numbers([&] { return complex_->refactorize(as_complex(values)); });
    if (!variant_.has("resident")) return numbers([&] { return solver_->refactorize(values); });
    if (!values_ || values_size_ != values.size()) {
      values_ = std::make_unique<DeviceArray<double>>(*cuda_, values.size());
      values_size_ = values.size();
    }
    values_->upload(values.data());
    check_cuda(*cuda_, cuda_->synchronize(), "cudaDeviceSynchronize");
    return numbers([&] {
      return solver_->refactorize_device(static_cast<const double*>(values_->get()), static_cast<Offset>(values_size_));
    });
  }
  SolveReport solve(std::span<const double> b, std::span<double> x, Index columns) override {
    SolveResult result;
    SolveReport report;
    if (complex_) {
      report.seconds = timed([&] { result = complex_->solve(as_complex(b), as_complex(x), columns); });
    } else if (!variant_.has("resident")) {
      report.seconds = timed([&] { result = solver_->solve(b, x, columns); });
    } else {
      DeviceArray<double> rhs(*cuda_, b.size()), solution(*cuda_, x.size());
      rhs.upload(b.data());
      check_cuda(*cuda_, cuda_->synchronize(), "cudaDeviceSynchronize");
      report.seconds = timed([&] {
        result =
            solver_->solve_device(static_cast<const double*>(rhs.get()), static_cast<double*>(solution.get()), columns);
      });
      if (result.status.ok()) solution.download(x.data());
    }
    check(result.status);
    report.refinement_steps = result.refinement_steps;
    return report;
  }

 private:
  /// Makes the contexts of the GPUs, outside of every clock, as it is done for cuDSS. The first of them is current
  /// afterwards: there lie the arrays of "resident".
  void open_gpus() {
    cuda_ = std::make_unique<Cuda>();
    int count = 0;
    const int error = cuda_->get_device_count(&count);
    if (error != 0) throw Failure(Outcome::missing, std::string("no GPU here: ") + cuda_->error_string(error));
    std::vector<int> devices;
    std::istringstream list(options_.device.substr(std::min<std::size_t>(4, options_.device.size())));
    for (std::string word; std::getline(list, word, ',');)
      if (word != "all") devices.push_back(std::atoi(word.c_str()));
    if (devices.empty())
      for (int k = 0; k < count; ++k) devices.push_back(k);
    for (auto device = devices.rbegin(); device != devices.rend(); ++device) {
      check_cuda(*cuda_, cuda_->set_device(*device), "cudaSetDevice");
      check_cuda(*cuda_, cuda_->free(nullptr), "cudaFree");
    }
  }
  template <typename Call>
  FactorReport numbers(Call&& call) {
    decltype(call()) result;
    FactorReport report;
    report.seconds = timed([&] { result = call(); });
    check(result.status);
    report.inertia = result.inertia;
    report.perturbed = result.perturbed;
    Offset device_bytes = 0;
    for (const DeviceReport& device : result.devices)
      if (device.name.compare(0, 4, "host") != 0) device_bytes += device.peak_bytes;
    if (device_bytes > 0) report.device_bytes = device_bytes;
    report.devices = std::move(result.devices);
    if (variant_.has("trace"))
      check(complex_ ? complex_->write_trace(variant_.text("trace"))
                     : solver_->write_trace(variant_.text("trace")));  // outside the clock
    return report;
  }

  /// "word=64" counts MiB, "word=64000KiB" what it says.
  [[nodiscard]] Offset bytes_of(const std::string& word) const {
    const std::string text = variant_.text(word, "0");
    const bool plain = text.find_first_not_of("0123456789") == std::string::npos;
    try {
      return solver::parse_bytes(plain ? text + "MiB" : text);
    } catch (const Error& error) {
      throw Failure(Outcome::failed, word + "=" + error.what());
    }
  }

  std::string text_;
  Variant variant_;
  Options options_;
  std::unique_ptr<Cuda> cuda_;  ///< with GPUs only
  std::unique_ptr<DeviceArray<double>> values_;
  std::size_t values_size_ = 0;
  std::unique_ptr<Solver> solver_;          ///< of a real system
  std::unique_ptr<ComplexSolver> complex_;  ///< of a complex one
};

}  // namespace
}  // namespace espalier::bench

ESPALIER_RIVAL_PLUGIN(espalier::bench::EspalierRival)
