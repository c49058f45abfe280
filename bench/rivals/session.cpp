#include "rivals/session.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <random>
#include <stdexcept>
#include <thread>

#include "rivals/real_equivalent.hpp"

namespace espalier::bench {
namespace {

constexpr std::uint32_t kSeed = 20180;  ///< of the right-hand sides

/// One rival in the race.
struct Runner {
  std::unique_ptr<Child> child;
  Row row;
  [[nodiscard]] bool alive() const { return row.verdict.ok(); }
};

class Session {
 public:
  Session(const SystemView& a, const Plan& plan, const Progress& progress)
      : plan_(plan), progress_(progress), original_(a.values), system_(a, std::max<Index>(plan.columns, 1)) {
    if (a.numbers != Numbers::real) equivalent_ = std::make_unique<RealEquivalent>(a);
    std::mt19937_64 generator(kSeed);
    std::uniform_real_distribution<double> uniform(-1, 1);
    for (double& b : system_.right_hand_sides()) b = uniform(generator);
  }

  std::vector<Row> run(const std::vector<std::string>& specs) {
    // All processes first: to load its libraries and to make its context on a GPU takes a rival seconds.
    std::vector<Runner> runners;
    for (const std::string& spec : specs) runners.push_back(start(spec));
    for (Runner& runner : runners) greet(runner);
    for (int round = 0; round < plan_.analyses; ++round) turn(runners, round, [&](Runner& runner) { analyze(runner); });
    set_round(0);
    turn(runners, 0, [&](Runner& runner) { factorize(runner); });
    if (plan_.repetitions == 0)
      turn(runners, 0, [&](Runner& runner) { solve_both(runner, runner.row.solve_one, runner.row.solve_many, true); });
    for (int round = 0; plan_.repetitions > 0 && round <= plan_.repetitions; ++round) {
      set_round(round);
      turn(runners, round, [&](Runner& runner) { repeat(runner, round); });
    }
    std::vector<Row> rows;
    for (Runner& runner : runners) {
      runner.row.peak_bytes = runner.child->memory().peak_bytes;
      rows.push_back(std::move(runner.row));
    }
    return rows;
  }

 private:
  Runner start(const std::string& spec) {
    progress_(spec + ": start");
    Runner runner;
    runner.child = std::make_unique<Child>(spec, system_, plan_.child);
    runner.row.spec = spec;
    return runner;
  }

  static void greet(Runner& runner) {
    const Hello& hello = runner.child->hello();
    runner.row.version = hello.version;
    runner.row.verdict = hello.verdict;
  }

  /// Gives every rival that is alive one turn; who begins changes from round to round.
  template <typename Step>
  void turn(std::vector<Runner>& runners, int round, Step&& step) {
    for (std::size_t k = 0; k < runners.size(); ++k) {
      Runner& runner = runners[(k + static_cast<std::size_t>(round)) % runners.size()];
      if (!runner.alive()) continue;
      std::this_thread::sleep_for(std::chrono::duration<double>(plan_.pause_seconds));
      step(runner);
    }
  }

  /// Values of round k: the original ones times 1 + k / 16, which no rival can know beforehand, or those of a sequence.
  void set_round(int round) {
    if (!plan_.sequence.empty()) {
      const auto& next = plan_.sequence[static_cast<std::size_t>(round) % plan_.sequence.size()];
      std::copy(next.begin(), next.end(), system_.values().begin());
      return;
    }
    const double factor = 1 + round / 16.0;
    const std::span<double> values = system_.values();
    for (std::size_t k = 0; k < values.size(); ++k) values[k] = factor * original_[k];
  }

  void analyze(Runner& runner) {
    progress_(runner.row.spec + ": analysis");
    const AnalyzeReport report = runner.child->analyze(plan_.kind, plan_.threads);
    runner.row.verdict = report.verdict;
    if (!report.verdict.ok()) return;
    runner.row.analysis.seconds.push_back(report.seconds);
    runner.row.nonzeros_factor = report.nonzeros_factor;
    runner.row.flops = report.flops;
    runner.row.predicted_bytes = report.predicted_bytes;
  }

  void factorize(Runner& runner) {
    progress_(runner.row.spec + ": first factorization");
    take(runner.row, runner.child->factorize(), runner.row.first_factorization);
  }

  /// One round: refactorization, solve with one and with many right-hand sides. Round 0 warms up and is checked in
  /// full; later rounds are timed, and the first column of each answer is checked.
  void repeat(Runner& runner, int round) {
    progress_(runner.row.spec + (round == 0 ? ": warm-up" : ": round " + std::to_string(round)));
    Samples warm_up;
    Row& row = runner.row;
    FactorReport report = runner.child->refactorize(plan_.warm && round > 0);
    take(row, report, round == 0 ? warm_up : row.refactorization);
    if (row.verdict.ok() && round > 0) row.devices.push_back(std::move(report.devices));
    if (!row.verdict.ok()) return;
    if (round == 0)
      solve_both(runner, warm_up, warm_up, true);
    else
      solve_both(runner, row.solve_one, row.solve_many, false);
  }

  /// With one and with many right-hand sides. `whole`: the answers are checked for every right-hand side.
  void solve_both(Runner& runner, Samples& one, Samples& many, bool whole) {
    solve(runner, 1, 1, one);
    if (runner.row.verdict.ok() && plan_.columns > 1) solve(runner, plan_.columns, whole ? plan_.columns : 1, many);
  }

  static void take(Row& row, const FactorReport& report, Samples& samples) {
    row.verdict = report.verdict;
    if (!report.verdict.ok()) return;
    samples.seconds.push_back(report.seconds);
    row.inertia = report.inertia;
    row.perturbed = report.perturbed;
    row.device_bytes = std::max(row.device_bytes, report.device_bytes);
    if (report.nonzeros_factor >= 0) row.nonzeros_factor = report.nonzeros_factor;
    if (report.flops >= 0) row.flops = report.flops;
  }

  void solve(Runner& runner, Index columns, Index checked, Samples& samples) {
    const SolveReport report = runner.child->solve(columns, plan_.warm);
    Row& row = runner.row;
    row.verdict = report.verdict;
    if (!report.verdict.ok()) return;
    samples.seconds.push_back(report.seconds);
    row.refinement_steps = std::max(row.refinement_steps, report.refinement_steps);
    const SystemView a = system_.matrix();
    const std::size_t count = static_cast<std::size_t>(checked) * static_cast<std::size_t>(a.parts() * a.rows);
    const matrix::BackwardErrors error =
        judge(runner.child->solutions().first(count), system_.right_hand_sides().first(count), checked);
    row.checked = true;
    row.error.normwise = std::max(row.error.normwise, error.normwise);
    row.error.componentwise = std::max(row.error.componentwise, error.componentwise);
    if (!(error.normwise <= plan_.wrong_above))
      row.verdict = {Outcome::wrong_answer,
                     fmt::format("normwise backward error {:.1e} is above {:.1e}", error.normwise, plan_.wrong_above)};
  }

  /// Large systems are judged on all cores; the threads end with it, so that none is there while a rival works.
  matrix::BackwardErrors judge(std::span<const double> x, std::span<const double> b, Index columns) {
    constexpr Offset kAlone = 10'000'000;  // entries times columns: about 0.1 s on one core
    const MatrixView a = equivalent_ ? equivalent_->with_values(system_.values()) : MatrixView(system_.matrix());
    if (a.nonzeros() * columns < kAlone) return matrix::backward_errors(a, x, b, columns);
    base::ThreadPool pool(plan_.threads);
    return matrix::backward_errors(a, x, b, columns, Transpose::no, &pool);
  }

  const Plan& plan_;
  const Progress& progress_;
  std::span<const double> original_;
  SharedSystem system_;
  std::unique_ptr<RealEquivalent> equivalent_;  ///< of a complex system: the form in which answers are judged
};

}  // namespace

std::vector<Row> compare(const SystemView& a, const Plan& plan, const Progress& progress) {
  if (plan.kind != Kind::lu && !a.symmetric())
    throw std::invalid_argument("compare: llt and ldlt need a matrix in symmetric storage");
  if (plan.kind == Kind::llt && a.numbers == Numbers::complex)
    throw std::invalid_argument("compare: llt of complex numbers needs a matrix in Hermitian storage");
  Session session(a, plan, progress);
  if (!plan.one_at_a_time) return session.run(plan.rivals);
  std::vector<Row> rows;
  for (const std::string& rival : plan.rivals) rows.push_back(session.run({rival}).front());
  return rows;
}

}  // namespace espalier::bench
