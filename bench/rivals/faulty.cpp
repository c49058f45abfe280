/// \file
/// A rival that misbehaves on request: the truth against which the benchmark's own error rows are tested. Its right
/// answers are those of a diagonal matrix.
#include <csignal>
#include <cstdlib>
#include <thread>

#include "rivals/rival.hpp"
#include "rivals/variant.hpp"

namespace espalier::bench {
namespace {

class Faulty : public Rival {
 public:
  explicit Faulty(const std::string& text) : variant_(text, "missing crash exit hang memory wrong refuse spin") {
    if (variant_.has("missing")) throw Failure(Outcome::missing, "asked to be missing");
  }
  [[nodiscard]] std::string name() const override { return "faulty"; }
  [[nodiscard]] std::string version() const override { return "1"; }

  AnalyzeReport analyze(const SystemView& a, Kind kind, int /*threads*/) override {
    if (kind == Kind::lu) throw Failure(Outcome::not_offered, "no lu");
    if (variant_.has("hang")) std::this_thread::sleep_for(std::chrono::hours(1));
    diagonal_.assign(static_cast<std::size_t>(a.rows), 0);
    return {};
  }
  FactorReport factorize(const SystemView& a) override {
    if (variant_.has("refuse")) throw Failure(Outcome::failed, "asked to refuse");
    if (variant_.has("memory")) big_.assign(std::size_t{1} << 40, 1.0);
    return refactorize(a.values);
  }
  FactorReport refactorize(std::span<const double> values) override {
    diagonal_.assign(values.begin(), values.end());
    FactorReport report;
    report.seconds = timed([this] { spin(); });
    return report;
  }
  SolveReport solve(std::span<const double> b, std::span<double> x, Index /*columns*/) override {
    if (variant_.has("crash")) std::raise(SIGSEGV);
    if (variant_.has("exit")) std::_Exit(3);
    const double factor = variant_.has("wrong") ? 1.001 : 1.0;
    for (std::size_t k = 0; k < x.size(); ++k) x[k] = factor * b[k] / diagonal_[k % diagonal_.size()];
    return {};
  }

 private:
  /// Takes as many microseconds as "spin=" says, whatever else runs.
  void spin() const {
    const auto end = std::chrono::steady_clock::now() + std::chrono::microseconds(variant_.number("spin", 0));
    while (std::chrono::steady_clock::now() < end) {
    }
  }

  Variant variant_;
  std::vector<double> diagonal_, big_;
};

}  // namespace
}  // namespace espalier::bench

ESPALIER_RIVAL_PLUGIN(espalier::bench::Faulty)
