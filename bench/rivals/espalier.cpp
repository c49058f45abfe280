/// \file
/// Espalier behind the same interface, through its public header (sizes are read by the library's own parser).
#include <memory>

#include "espalier/solver.hpp"
#include "rivals/rival.hpp"
#include "rivals/variant.hpp"
#include "solver/option_text.hpp"

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

Precision precision_named(const std::string& word) {
  if (word == "fp64") return Precision::fp64;
  if (word == "fp32") return Precision::fp32;
  if (word == "mixed") return Precision::mixed;
  throw Failure(Outcome::failed, "precision=" + word + ": known are fp64, fp32, mixed");
}

class EspalierRival : public Rival {
 public:
  explicit EspalierRival(const std::string& text)
      : text_(text),
        variant_(text, "device precision refine block memory hostmemory nomatching trace subtrees nosteal alonetop") {
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
  }

  [[nodiscard]] std::string name() const override { return "espalier"; }
  [[nodiscard]] std::string version() const override {
    return "Espalier, device " + options_.device + (text_.empty() ? "" : "; " + text_);
  }

  AnalyzeReport analyze(const MatrixView& a, Kind kind, int threads) override {
    options_.kind = kind;
    options_.threads = threads;
    solver_ = std::make_unique<Solver>(options_);
    AnalysisResult result;
    AnalyzeReport report;
    report.seconds = timed([&] { result = solver_->analyze(a); });
    check(result.status);
    report.nonzeros_factor = result.nonzeros_factor;
    report.flops = result.flops;
    report.predicted_bytes = result.predicted_bytes;
    return report;
  }
  FactorReport factorize(const MatrixView& a) override {
    return numbers([&] { return solver_->factorize(a); });
  }
  FactorReport refactorize(std::span<const double> values) override {
    return numbers([&] { return solver_->refactorize(values); });
  }
  SolveReport solve(std::span<const double> b, std::span<double> x, Index columns) override {
    SolveResult result;
    SolveReport report;
    report.seconds = timed([&] { result = solver_->solve(b, x, columns); });
    check(result.status);
    report.refinement_steps = result.refinement_steps;
    return report;
  }

 private:
  template <typename Call>
  FactorReport numbers(Call&& call) {
    FactorResult result;
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
    if (variant_.has("trace")) check(solver_->write_trace(variant_.text("trace")));  // outside the clock
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
  std::unique_ptr<Solver> solver_;
};

}  // namespace
}  // namespace espalier::bench

ESPALIER_RIVAL_PLUGIN(espalier::bench::EspalierRival)
