/// \file
/// The process in which one rival runs: loads the plug-in, obeys commands, answers in JSON. It is started by the
/// benchmark (child.cpp), not by people.
#include <dlfcn.h>
#include <sys/prctl.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <fstream>
#include <iostream>
#include <limits>
#include <map>
#include <memory>
#include <new>

#include "rivals/process_memory.hpp"
#include "rivals/protocol.hpp"
#include "rivals/shared_system.hpp"

namespace espalier::bench {
namespace {

/// Runs `call` and turns what it throws into the verdict of the report.
template <typename Report, typename Call>
Report guarded(Call&& call) {
  Report report;
  try {
    report = call();
  } catch (const Failure& failure) {
    report.verdict = {failure.outcome(), failure.what()};
  } catch (const std::bad_alloc&) {
    report.verdict = {Outcome::out_of_memory, "an allocation was refused"};
  } catch (const std::exception& error) {
    report.verdict = {Outcome::failed, error.what()};
  }
  return report;
}

/// Sends one line; ends this process where the benchmark has gone away.
void answer(const nlohmann::json& json) {
  const std::string line = json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
  std::size_t sent = 0;
  while (sent < line.size()) {
    const ssize_t count = write(kAnswerDescriptor, line.data() + sent, line.size() - sent);
    if (count <= 0) std::_Exit(1);
    sent += static_cast<std::size_t>(count);
  }
}

std::unique_ptr<Rival> load(const std::string& plugin, const char* variant) {
  void* handle = dlopen(plugin.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (handle == nullptr) throw Failure(Outcome::missing, dlerror());
  const auto make = reinterpret_cast<MakeRival>(dlsym(handle, kMakeRivalSymbol));
  if (make == nullptr) throw Failure(Outcome::missing, plugin + " is not a rival's plug-in");
  return std::unique_ptr<Rival>(make(variant));
}

class Host {
 public:
  Host(std::unique_ptr<Rival> rival, SharedSystem system, SharedMemory solutions)
      : rival_(std::move(rival)), system_(std::move(system)), solutions_(std::move(solutions)) {
    values_.assign(system_.matrix().values.begin(), system_.matrix().values.end());
    baseline_ = resident_bytes();
  }

  [[nodiscard]] nlohmann::json obey(const nlohmann::json& command) {
    const std::string verb = command.at("do");
    const SystemView a = system_.matrix();
    if (verb == "analyze")
      return guarded<AnalyzeReport>([&] {
        if (a.numbers != Numbers::real && !rival_->has_complex())
          throw Failure(Outcome::not_offered, rival_->name() + " is given real systems only");
        return rival_->analyze(a, kind_named(command.at("kind")), command.at("threads"));
      });
    if (verb == "factorize") return guarded<FactorReport>([&] { return rival_->factorize(a); });
    if (verb == "refactorize") return guarded<FactorReport>([&] { return refactorize(a.values, command.at("warm")); });
    if (verb == "solve") return guarded<SolveReport>([&] { return solve(command.at("columns"), command.at("warm")); });
    return MemoryReport{peak_resident_bytes() - baseline_ - rival_->overhead_bytes()};
  }

 private:
  FactorReport refactorize(std::span<const double> values, bool warm) {
    if (warm) warm_up(last_factor_, [&] { return rival_->refactorize(values_); });
    // Out of the shared memory, whose small pages cost a chain of small bodies 4 % of a refactorization.
    std::copy(values.begin(), values.end(), values_.begin());
    FactorReport report = rival_->refactorize(values_);
    last_factor_ = report.seconds;
    return report;
  }
  SolveReport solve(Index columns, bool warm) {
    double& last = last_solve_.try_emplace(columns, std::numeric_limits<double>::infinity()).first->second;
    if (warm) warm_up(last, [&] { return solve(columns); });
    const SolveReport report = solve(columns);
    last = report.seconds;
    return report;
  }
  SolveReport solve(Index columns) {
    const SystemView a = system_.matrix();
    const auto count = static_cast<std::size_t>(a.parts() * a.rows) * static_cast<std::size_t>(columns);
    auto* x = reinterpret_cast<double*>(solutions_.bytes().data());
    return rival_->solve(system_.right_hand_sides().first(count), {x, count}, columns);
  }

  std::unique_ptr<Rival> rival_;
  SharedSystem system_;
  SharedMemory solutions_;
  std::vector<double> values_;
  double last_factor_ = std::numeric_limits<double>::infinity();
  std::map<Index, double> last_solve_;  ///< by the number of right-hand sides
  Offset baseline_ = 0;
};

int run(const std::string& plugin, const char* variant) {
  std::unique_ptr<Rival> rival;
  const Hello hello = guarded<Hello>([&] {
    rival = load(plugin, variant);
    return Hello{{}, rival->name(), rival->version()};
  });
  answer(hello);
  if (!hello.verdict.ok()) return 0;
  Host host(std::move(rival), SharedSystem(SharedMemory::adopt(kSystemDescriptor)),
            SharedMemory::adopt(kSolutionDescriptor));
  std::ifstream commands("/proc/self/fd/" + std::to_string(kCommandDescriptor));
  std::string line;
  while (std::getline(commands, line)) answer(host.obey(nlohmann::json::parse(line)));
  return 0;
}

}  // namespace
}  // namespace espalier::bench

int main(int count, char** arguments) {
  if (count != 3) {
    std::cerr << "This program is started by `espalier bench`.\n";
    return 2;
  }
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  std::ofstream("/proc/self/oom_score_adj") << 1000;  // where memory runs out, this process goes, not its neighbours
  // Ends without destructors of foreign libraries, some of which hang when their threads are gone.
  std::_Exit(espalier::bench::run(arguments[1], arguments[2]));
}
