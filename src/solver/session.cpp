#include "solver/session.hpp"

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <new>
#include <utility>

#include "base/beside.hpp"
#include "base/forks.hpp"
#include "solver/device_text.hpp"
#include "solver/option_check.hpp"

namespace espalier::solver {

namespace {

// Where the caller says nothing: what the environment says to programs with threads ("4", or "4,2" for nested ones),
// else all cores.
int usual_threads() {
  if (const char* text = std::getenv("OMP_NUM_THREADS")) {
    int threads = 0;
    const auto [end, error] = std::from_chars(text, text + std::strlen(text), threads);
    if (error == std::errc{} && (*end == '\0' || *end == ',') && threads >= 1) return std::min(threads, kMostThreads);
  }
  return base::available_cores();
}

base::Interruption::Clock::duration period_of(const Options& o) {
  const std::chrono::duration<double> seconds(o.interrupted_every);
  return std::chrono::duration_cast<base::Interruption::Clock::duration>(seconds);
}

std::unique_ptr<base::Timeline> timeline_of(const Options& o) {
  return o.record_timeline ? std::make_unique<base::Timeline>() : nullptr;
}

}  // namespace

int threads_of(const Options& o) {
  check_options(o);
  const int threads = o.threads > 0 ? o.threads : usual_threads();
  const auto host = host_devices(o.device, threads);
  return host ? host->devices * host->threads : threads;
}

Session::Session(Options the_options, const device::Registry& registry)
    : options(std::move(the_options)),
      interruption(options.interrupted, period_of(options)),
      pool(threads_of(options), &interruption),
      budget("host memory", options.host_memory_bytes),
      timeline(timeline_of(options)),
      context{options, registry, pool, budget, timeline.get()} {}

Session::Session(const Session& other, int threads)
    : options(other.options),
      interruption(options.interrupted, period_of(options)),
      pool(threads > 0 ? threads : other.pool.size(), &interruption),
      budget("host memory", options.host_memory_bytes),
      timeline(timeline_of(options)),
      context{options, other.context.registry, pool, budget, timeline.get()} {
  if (!other.factor) return;
  Values values;
  values.resize(static_cast<std::size_t>(other.current().system->prepared.a.nonzeros()));
  factor.emplace(other.factor->analysis(), std::move(values), context);
  analysis = other.analysis;
}

// What belongs to a device or to a thread of the parent cannot be ended in the child of a fork(): it is left alone.
Session::~Session() {
  if (!device_lost()) return;
  if (factor) factor->abandon();
  (void)new (std::nothrow) std::future<void>(std::move(opening));
}

bool Session::device_lost() const { return forks && *forks != base::forks(); }

void Session::expect_usable() const {
  if (device_lost())
    throw Error(StatusCode::device_error,
                "this solver has used a GPU before fork(), and CUDA does not follow into the child; make a new solver "
                "there, with device cpu, or start the process afresh (Python: multiprocessing's 'spawn')");
}

void Session::note_devices() {
  if (current().device.backend->limits().own_memory) forks = base::forks();
}

void Session::analyze(const MatrixView& a) {
  factor.reset();
  open_devices();
  take(solver::analyze(a, context));
}

void Session::load_analysis(const std::string& path, const MatrixView& a) {
  factor.reset();
  open_devices();
  take(solver::load_analysis(path, a, context));
}

void Session::take(Analyzed made) {
  analysis = made.analysis->result;
  factor.emplace(std::move(made.analysis), std::move(made.values), context);
}

// A driver's start and the contexts take as long as an analysis.
void Session::open_devices() {
  if (opening.valid()) return;
  const auto named = named_devices(options.device, context.registry);
  if (!named || !named->backend->limits().own_memory) return;
  forks = base::forks();
  opening = base::start_beside([backend = named->backend, numbers = named->numbers] { backend->open(numbers); });
}

}  // namespace espalier::solver
