#include "harmonic/teams.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <numbers>

#include "base/stage.hpp"
#include "base/stopwatch.hpp"
#include "matrix/file.hpp"
#include "solver/session/status_of.hpp"
#include "solver/solution/solution.hpp"

namespace espalier::harmonic {
namespace {

using solver::Session;

Options solver_options(const Options& from) {
  Options o = from;
  o.kind = Kind::automatic;
  o.precision = Precision::fp64;
  o.singular = SingularMatrix::error;
  o.permutation.clear();
  o.record_timeline = false;
  return o;
}

// Teams beside each other do not call back, but for the one of the thread that called, which asks whether to stop for
// all; and they share what memory there is.
Options options_of_team(Options o, int threads, int teams, base::Interruption& interruption) {
  o.threads = threads;
  if (teams == 1) return o;
  o.log = nullptr;
  if (o.interrupted)
    o.interrupted = [&interruption] {
      try {
        interruption.check();
        return false;
      } catch (const Error&) {
        return true;
      }
    };
  if (o.host_memory_bytes > 0) o.host_memory_bytes = std::max<Offset>(1, o.host_memory_bytes / teams);
  return o;
}

double largest(std::span<const Complex> x) {
  double most = 0;
  for (const Complex& v : x)
    if (const double size = std::abs(v); !(size <= most)) most = size;  // NaN, too
  return most;
}

const double* parts(const Complex* x) { return reinterpret_cast<const double*>(x); }

SolveResult solved(Session& s, const Complex* b, Complex* x, Index columns) {
  return solver::solve(*s.factor, {parts(b), reinterpret_cast<double*>(x), columns, false}, s.context);
}

}  // namespace

Teams::Team::Team(const Options& options, const solver::SharedAnalysis& analysis) : session(options) {
  if (analysis == nullptr) return;
  solver::Values values;
  const solver::System& system = *analysis->system;
  values.resize(static_cast<std::size_t>(system.prepared.a.nonzeros() * system.parts()));
  session.factor.emplace(analysis, std::move(values), session.context);
}

Teams::Teams(const DynamicStiffness& z, std::span<const Complex> loads, Index columns, const HarmonicOptions& options,
             modes::Resources& shop, HarmonicResult& result)
    : z_(z), loads_(loads), columns_(columns), shop_(shop), result_(result), options_(solver_options(options.solver)) {}

void Teams::begin(double frequency) {
  const base::Stopwatch watch(result_.seconds.analysis);
  whole_ = std::make_unique<Team>(options_of_team(options_, shop_.pool.size(), 1, shop_.interruption), nullptr);
  z_.evaluate(2 * std::numbers::pi * frequency, whole_->z);
  try {
    whole_->session.analyze(solver::given(z_.view(whole_->z)));
  } catch (const Error& e) {
    if (e.status().code != StatusCode::singular) throw;
    throw Error(StatusCode::singular,
                fmt::format("K (1 + i eta) + i w C - w^2 M is singular by its pattern at frequency {:g}, and so at "
                            "every other one ({})",
                            frequency, e.what()),
                e.status().row);
  }
}

// Several at a time pay where the threads have too little to do in one factor, and where memory is no matter.
int Teams::most_teams() const {
  // The work of a factorization, for each thread. Elasticity with two threads of two cores, 30 frequencies: 2e8 to 3e9
  // operations take 5 to 15 % less time side by side, 6e9 take 5 % more (design/harmonic.md).
  constexpr double kMostFlops = 2e9;
  constexpr double kShareOfMachine = 0.25;  // of memory, where the caller sets no limit
  const solver::Analysis& a = *analysis_;
  if (a.flops() > kMostFlops * shop_.pool.size()) return 1;
  const Offset limit = options_.host_memory_bytes;
  const double room =
      limit > 0 ? static_cast<double>(limit) : kShareOfMachine * static_cast<double>(matrix::machine_memory());
  const double each = static_cast<double>(std::max<Offset>(1, a.result.predicted_bytes));
  const double fit = room / each - 1;  // beside the one that has all threads
  return static_cast<int>(std::clamp(fit, 1.0, static_cast<double>(shop_.pool.size())));
}

Teams::Team& Teams::fresh(std::unique_ptr<Team>& team, int threads, int beside) {
  if (team == nullptr || !team->session.factor->like_new())
    team = std::make_unique<Team>(options_of_team(options_, threads, beside, shop_.interruption), analysis_);
  return *team;
}

// The largest relative change of a solution that rounding of the entries of Z may cause, to its order of magnitude.
double Teams::rounding_of(Team& team, double w, const std::vector<Complex>& x, double z_norm, Answer& out) const {
  constexpr double kEps = std::numeric_limits<double>::epsilon();
  // |Z| |x| / |f| is a lower bound of the condition: where that is harmless, nothing more is looked at.
  constexpr double kWorthALook = 1e-9;
  const auto n = static_cast<std::size_t>(z_.n());
  std::vector<Complex> d(n);
  double worst = 0;
  for (std::size_t c = 0; c < static_cast<std::size_t>(columns_); ++c) {
    const double size = largest({x.data() + c * n, n});
    if (!std::isfinite(size)) return size;
    if (!(size * z_norm * kEps > kWorthALook * largest(loads_.subspan(c * n, n)))) continue;
    z_.magnitudes(w, x.data() + c * n, d.data());
    const Status status = solved(team.session, d.data(), d.data(), 1).status;
    ++out.solved_columns;
    if (!status.ok() && status.code != StatusCode::accuracy_not_reached) throw Error(status);
    worst = std::max(worst, kEps * largest(d) / size);
  }
  return worst;
}

Answer Teams::solve_one(Team& team, double frequency) const {
  Answer out;
  const double w = 2 * std::numbers::pi * frequency;
  out.x.assign(loads_.begin(), loads_.end());
  const Status status = solver::status_of(team.session.interruption, "use fewer threads", [&] {
    z_.evaluate(w, team.z);
    {
      const base::Stopwatch watch(out.factor_seconds);
      team.session.factor->factorize({parts(team.z.data()), 2 * team.z.size()});
      out.status = team.session.factor->result().status;
    }
    if (!out.status.ok()) return;
    const base::Stopwatch watch(out.solve_seconds);
    const SolveResult r = solved(team.session, out.x.data(), out.x.data(), columns_);
    out.solved_columns += columns_;
    out.status = r.status;
    out.backward_error = r.backward_error;
    if (r.status.ok()) out.rounding = rounding_of(team, w, out.x, z_.norm(w), out);
  });
  if (!status.ok()) {
    if (team.session.factor) team.session.factor->drop();
    throw Error(status);
  }
  return out;
}

std::size_t Teams::at_a_time() const {
  constexpr double kMostNumbers = 1 << 23;  // of all solutions
  constexpr double kMost = 32;
  const double numbers = std::max(1.0, static_cast<double>(loads_.size()));
  return static_cast<std::size_t>(std::clamp(kMostNumbers / numbers, static_cast<double>(shop_.pool.size()),
                                             std::max(kMost, static_cast<double>(shop_.pool.size()))));
}

std::vector<Answer> Teams::solve(std::span<const double> frequencies) {
  std::vector<Answer> out(frequencies.size());
  if (frequencies.empty()) return out;
  base::Stage* const stage = base::Stage::current("frequency response");
  const auto tell = [stage] {
    if (stage != nullptr) stage->add(1);
  };
  if (analysis_ == nullptr) begin(frequencies[0]);
  double wall = 0;
  {
    const base::Stopwatch watch(wall);
    std::size_t done = 0;
    if (analysis_ == nullptr) {
      out[done++] = solve_one(*whole_, frequencies[0]);
      analysis_ = whole_->session.factor->analysis();
      tell();
    }
    const int workers = most_teams();
    if (workers == 1 || done + 1 >= frequencies.size()) {
      for (; done < frequencies.size(); ++done) {
        shop_.interruption.check();
        out[done] = solve_one(fresh(whole_, shop_.pool.size(), 1), frequencies[done]);
        tell();
      }
    } else {
      teams_.resize(static_cast<std::size_t>(workers));
      std::atomic<std::size_t> next{done};
      shop_.pool.share([&](int worker) {
        if (worker >= workers) return;
        for (std::size_t k = next++; k < frequencies.size(); k = next++) {
          shop_.interruption.check();
          out[k] = solve_one(fresh(teams_[static_cast<std::size_t>(worker)], 1, workers), frequencies[k]);
          tell();
        }
      });
    }
  }
  double factor = 0, solve = 0;
  for (const Answer& a : out) {
    factor += a.factor_seconds;
    solve += a.solve_seconds;
    result_.solved_columns += a.solved_columns;
    ++result_.factorizations;
  }
  const double share = factor + solve > 0 ? factor / (factor + solve) : 1;
  result_.seconds.factorization += wall * share;
  result_.seconds.solves += wall * (1 - share);
  return out;
}

}  // namespace espalier::harmonic
