#include "solver/options/executor_choice.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <limits>
#include <utility>

#include "out_of_core/executor.hpp"
#include "out_of_core/factory.hpp"
#include "solver/ranks/first_rank_executor.hpp"

namespace espalier::solver {

namespace {

using device::Backend;
using device::Job;

// A buffer of the staging ring: 8 MiB hide the start of a copy; a small budget needs no more than a part of itself.
Offset slot_bytes(Offset budget) {
  constexpr Offset kMost = 8 << 20, kLeast = 64 << 10, kPage = 4096;
  return std::clamp(budget / 32 / kPage * kPage, kLeast, kMost);
}

// What is page-locked is lost to all other programs: half of the machine's memory at most, unless more was asked for.
Offset pinned_bytes(Offset asked) {
  if (asked >= 0) return asked;
  return static_cast<Offset>(::sysconf(_SC_PHYS_PAGES)) * ::sysconf(_SC_PAGE_SIZE) / 2;
}

// What each device may take: of its own memory what is free, less a quarter for every attempt before; else as the
// caller said, or all that the factorization could use.
std::vector<Offset> device_bytes(const Backend& backend, const Job& job, Offset need, int attempts_before) {
  std::vector<Offset> list = job.memory_bytes;
  for (std::size_t d = 0; d < list.size(); ++d) {
    Offset& bytes = list[d];
    if (!backend.limits().own_memory) {
      if (bytes == 0) bytes = need;
      continue;
    }
    const Offset free = backend.free_bytes(job.devices[d]);
    bytes = bytes > 0 ? std::min(free, bytes) : free;
    for (int k = 0; k < attempts_before; ++k) bytes -= bytes / 4;
  }
  return list;
}

template <class T>
Offset in_core_bytes(const Job& job) {
  return job.plan.memory.size * static_cast<Offset>(sizeof(T));
}

// The bytes of what an executor takes on the host.
template <class T>
Offset bytes_beside_arena(const Backend& backend, const Job& job) {
  const int threads = job.pool.size();
  const Precision precision = sizeof(base::RealOf<T>) == sizeof(double) ? Precision::fp64 : Precision::fp32;
  const Offset all = base::ScalarTraits<T>::is_complex
                         ? backend.complex_executor_bytes(job.plan, job.kind, precision, threads)
                         : backend.executor_bytes(job.plan, job.kind, precision, threads);
  return std::max<Offset>(0, all - in_core_bytes<T>(job));
}

// What is taken when there is an executor: values, as the caller gave them and scaled, those of before where fronts are
// kept, and vectors of a solve.
template <class T>
Offset bytes_of_solve(const Job& job) {
  constexpr Offset kVectors = 8, kMore = 1 << 20;
  const Offset values = job.plan.options.keep_contributions ? 3 : 2;
  return (kVectors * job.plan.tree.n + values * static_cast<Offset>(job.plan.entries.size())) *
             static_cast<Offset>(sizeof(T)) +
         kMore;
}

// Host devices whose factor goes to the disk share what the budget leaves with the store's window: it must hold the
// largest front, and three tenths of the rest keep it from waiting for the disk.
template <class T>
std::vector<Offset> arenas_beside_disk(const DeviceChoice& device, const Job& job, Offset left) {
  const auto size = static_cast<Offset>(sizeof(T));
  Offset largest = 0;
  for (Index f = 0; f < job.plan.fronts(); ++f) largest = std::max(largest, job.plan.layout[f].factor_size() * size);
  const Offset others = bytes_beside_arena<T>(*device.backend, job) + bytes_of_solve<T>(job);
  const auto rest = static_cast<double>(std::max<Offset>(0, left - others));
  constexpr double kWindow = 0.3, kRing = 0.1;  // of the arena: see slot_bytes_beside_disk()
  const double window = std::max(kWindow * rest, 1.15 * static_cast<double>(largest) + 0.02 * rest);
  const auto arena = static_cast<Offset>(std::max(0.0, rest - window) / (1 + kRing));
  const Offset each = std::max<Offset>(1, arena / device.devices());
  std::vector<Offset> list = job.memory_bytes;
  for (Offset& bytes : list) bytes = bytes > 0 ? std::min(bytes, each) : each;
  return list;
}

Offset slot_bytes_beside_disk(Offset arena) {
  constexpr Offset kMost = 8 << 20, kLeast = 16 << 10, kPage = 4096, kSlots = 128;
  return std::clamp(arena / kSlots / kPage * kPage, kLeast, kMost);
}

// By what plans are made that keep to the disk's rate. Nominal, since the same plan is to be made again: 1 GB/s.
void plan_for_disk(out_of_core::PlanningRates& rates) {
  constexpr double kRate = 1e9;
  rates.bytes_in = rates.bytes_out = rates.host_bytes = rates.host_solve = kRate;
}

out_of_core::OutOfCoreOptions out_of_core_options(const DeviceChoice& device, const Job& job,
                                                  const std::vector<Offset>& bytes, const Context& context) {
  out_of_core::OutOfCoreOptions o;
  for (std::size_t d = 0; d < bytes.size(); ++d)
    o.devices.push_back({bytes[d], device.speed.empty() ? 1 : device.speed[d]});
  o.slot_bytes = slot_bytes(*std::min_element(bytes.begin(), bytes.end()));
  if (device.backend->limits().own_memory) {
    o.copy_threads = std::max(1, job.pool.size() / (2 * device.devices()));
    o.pinned_bytes = pinned_bytes(context.options.pinned_memory_bytes);
  }
  o.interruption = job.pool.interruption();
  o.pool = &job.pool;
  o.rates = out_of_core::PlanningRates(job.plan.options.machine.out_of_core, job.kind, o.pinned_bytes > 0);
  if (!device.backend->limits().own_memory) o.rates.device_solve = o.rates.host_solve;  // it is the host that solves
  o.rates.keep_contributions = job.plan.options.keep_contributions;
  return o;
}

// What a store on disk takes of the host's memory, and host devices beside it.
template <class T>
void use_disk(const DeviceChoice& device, const Job& job, const Context& context, out_of_core::OutOfCoreOptions& o) {
  const bool on_host = !device.backend->limits().own_memory;
  o.disk.folder = context.options.scratch;
  o.disk.window_bytes = std::numeric_limits<Offset>::max();
  o.left_bytes = bytes_of_solve<T>(job);
  if (!on_host) return;
  Offset least = o.devices.front().budget_bytes;
  for (const out_of_core::OutOfCoreDevice& d : o.devices) least = std::min(least, d.budget_bytes);
  o.slot_bytes = slot_bytes_beside_disk(least);
  plan_for_disk(o.rates);
}

template <class T>
DiskForecast disk_forecast(const DeviceChoice& device, const Job& job, Offset left, const Context& context) {
  const std::vector<Offset> bytes = arenas_beside_disk<T>(device, job, left);
  auto options = out_of_core_options(device, job, bytes, context);
  use_disk<T>(device, job, context, options);
  options.disk.window_bytes = left - options.left_bytes;
  const out_of_core::DiskPrediction p =
      out_of_core::predict_disk<T>(device.backend->out_of_core()->make(job, device::Scalar<T>()), options);
  return {p.file_bytes, p.factorization.written_bytes, p.factorization.read_bytes, p.way_read_bytes};
}

// What a budget has to leave for a factor on disk. @param left  is too little
template <class T>
Offset least_left_for_disk(const DeviceChoice& device, const Job& job, Offset left, const Context& context) {
  constexpr Offset kParts = 64, kLeast = 1 << 14;  // what is named is that much too large, or a little more
  const auto arena = [&](Offset with) {
    const std::vector<Offset> bytes = arenas_beside_disk<T>(device, job, with);
    return *std::min_element(bytes.begin(), bytes.end());
  };
  // `with` where so much does; else more, and no less than what is known to be missing.
  const auto at_least = [&](Offset with) {
    const Offset step = kLeast + with / kParts;
    try {
      (void)disk_forecast<T>(device, job, with, context);
    } catch (const out_of_core::BudgetTooSmall& e) {
      do with += step;
      while (arena(with) < e.needed());
    } catch (const out_of_core::WindowTooSmall& e) {
      with += std::max(e.missing(), step);
    }
    return with;
  };
  // Each attempt lays out a plan: so much that does is looked for by quarters, then the least by halves.
  Offset enough = std::max<Offset>(left, 0), below = enough;
  for (Offset least = 0; (least = at_least(enough)) != enough; enough = std::max(least, enough + enough / 4))
    below = least;
  while (enough - below > kLeast + below / kParts) {
    const Offset middle = below + (enough - below) / 2, least = at_least(middle);
    if (least == middle)
      enough = middle;
    else
      below = least;
  }
  return enough;
}

// make(), where the budget leaves so much for a factor on disk. @throws Error(out_of_memory) naming a budget that does
template <class T, class Make>
auto with_room_for_disk(const DeviceChoice& device, const Job& job, Offset left, const Context& context, Make&& make) {
  const auto refuse = [&] {
    const Offset limit = context.budget.limit();
    return Error(
        StatusCode::out_of_memory,
        fmt::format("the budget of {} on the host is too small for a factor on disk; one of {} bytes would do "
                    "(--host-memory)",
                    base::format_bytes(limit), limit - left + least_left_for_disk<T>(device, job, left, context)));
  };
  try {
    return make();
  } catch (const out_of_core::BudgetTooSmall&) {
    throw refuse();
  } catch (const out_of_core::WindowTooSmall&) {
    throw refuse();
  }
}

// On host devices whose budget does not take the factor.
template <class T>
std::unique_ptr<device::Executor<T>> make_on_disk(const DeviceChoice& device, const Job& job, const Context& context) {
  const Offset left = context.budget.limit() - context.budget.held();
  return with_room_for_disk<T>(device, job, left, context, [&] {
    auto options = out_of_core_options(device, job, arenas_beside_disk<T>(device, job, left), context);
    use_disk<T>(device, job, context, options);
    return out_of_core::make_out_of_core_executor<T>(device.backend->out_of_core()->make(job, device::Scalar<T>()),
                                                     options, job.budget);
  });
}

// When others take memory of a device in between, with less of it.
template <class T>
std::unique_ptr<device::Executor<T>> make_out_of_core(const DeviceChoice& device, const Job& job,
                                                      const Context& context) {
  const Backend& backend = *device.backend;
  const bool scratch = !context.options.scratch.empty();
  if (scratch && !backend.limits().own_memory && context.budget.limit() > 0)
    return make_on_disk<T>(device, job, context);
  const int attempts = backend.limits().own_memory ? 4 : 1;
  const Offset need = in_core_bytes<T>(job);
  for (int attempt = 0;; ++attempt) {
    const std::vector<Offset> bytes = device_bytes(backend, job, need, attempt);
    try {
      auto options = out_of_core_options(device, job, bytes, context);
      if (scratch) use_disk<T>(device, job, context, options);
      return out_of_core::make_out_of_core_executor<T>(backend.out_of_core()->make(job, device::Scalar<T>()), options,
                                                       job.budget);
    } catch (const out_of_core::AllocationRefused&) {
      if (attempt + 1 == attempts) throw;
    }
  }
}

// The devices of ranks that have a device each, the devices of the first one's machine, once each, as the first one
// sees them.
template <class T>
std::unique_ptr<device::Executor<T>> make_out_of_core_on_first_rank(const DeviceChoice& all, const Job& job,
                                                                    base::ThreadPool& pool, const Context& context) {
  const ranks::Communicator& link = *context.link;
  DeviceChoice seen = all;
  Job own{job.plan, job.kind, job.hermitian, job.rule, pool, job.budget, job.timeline, {}, {}, nullptr};
  seen.numbers.clear();
  seen.speed.clear();
  const auto found = static_cast<int>(all.backend->find().names.size());
  for (int r = 0; r < link.size(); ++r) {
    const auto at = static_cast<std::size_t>(r);
    const int number = all.numbers[at];
    const bool known = std::find(seen.numbers.begin(), seen.numbers.end(), number) != seen.numbers.end();
    if (known || number >= found || link.machine_of(r) != link.machine_of(0)) continue;
    seen.numbers.push_back(number);
    if (!all.speed.empty()) seen.speed.push_back(all.speed[at]);
    own.memory_bytes.push_back(job.memory_bytes[at]);
  }
  own.devices = seen.numbers;
  return make_out_of_core<T>(seen, own, context);
}

Job job_of(const Analysis& analysis, const device::PivotRule& rule, const Context& context) {
  Job job{analysis.plan,
          analysis.kind(),
          analysis.system->complex_factor() && analysis.system->numbers() == base::Numbers::hermitian,
          rule,
          context.pool,
          &context.budget,
          context.timeline,
          analysis.device.numbers,
          budgets_of(analysis.device, context.options),
          context.link};
  if (const auto& real_form = analysis.system->real_form) job.pair_sign = real_form->hermitian ? -1 : 1;
  return job;
}

template <class T>
Offset out_of_core_bytes(const DeviceChoice& device, const Job& job, const Context& context) {
  const std::vector<Offset> bytes = device_bytes(*device.backend, job, in_core_bytes<T>(job), 0);
  const out_of_core::OutOfCoreOptions o = out_of_core_options(device, job, bytes, context);
  return out_of_core::host_bytes<T>(device.backend->out_of_core()->make(job, device::Scalar<T>()), o);
}

}  // namespace

Offset predicted_executor_bytes(const Analysis& analysis, const Context& context) {
  const Backend& backend = *analysis.device.backend;
  const bool complex = analysis.system->complex_factor(), fp64 = context.precision() == Precision::fp64;
  const int threads = context.pool.size();
  const Offset in_core =
      complex ? backend.complex_executor_bytes(analysis.plan, analysis.kind(), context.precision(), threads)
              : backend.executor_bytes(analysis.plan, analysis.kind(), context.precision(), threads);
  const auto* factory = backend.out_of_core();
  if (factory == nullptr || analysis.plan.tree.border > 0 || context.link != nullptr) return in_core;
  const Job job = job_of(analysis, {}, context);
  const std::vector<Offset> needed = factory->in_core_bytes(job, context.precision(), complex);
  bool fits = true;
  for (std::size_t d = 0; d < needed.size(); ++d)
    fits = fits && (job.memory_bytes[d] == 0 || needed[d] <= job.memory_bytes[d]);
  if (fits) return in_core;
  try {
    if (complex)
      return fp64 ? out_of_core_bytes<std::complex<double>>(analysis.device, job, context)
                  : out_of_core_bytes<std::complex<float>>(analysis.device, job, context);
    return fp64 ? out_of_core_bytes<double>(analysis.device, job, context)
                : out_of_core_bytes<float>(analysis.device, job, context);
  } catch (const out_of_core::BudgetTooSmall&) {
    return in_core;  // the factorization says what is needed
  }
}

namespace {

// use(scalar): of the analysis' factor.
template <class Use>
auto of_factor(const Analysis& analysis, const Context& context, Use&& use) {
  const bool fp64 = context.precision() == Precision::fp64;
  if (analysis.system->complex_factor())
    return fp64 ? use(device::Scalar<std::complex<double>>()) : use(device::Scalar<std::complex<float>>());
  return fp64 ? use(device::Scalar<double>()) : use(device::Scalar<float>());
}

}  // namespace

DiskForecast predict_disk(const Analysis& analysis, const Context& context, Offset left_bytes) {
  const Backend& backend = *analysis.device.backend;
  if (backend.limits().own_memory || backend.out_of_core() == nullptr || analysis.plan.tree.border > 0 ||
      context.link != nullptr)
    return {};
  const Job job = job_of(analysis, {}, context);
  return of_factor(analysis, context, [&]<class T>(device::Scalar<T>) {
    return with_room_for_disk<T>(analysis.device, job, left_bytes, context,
                                 [&] { return disk_forecast<T>(analysis.device, job, left_bytes, context); });
  });
}

Offset least_budget_on_disk(const Analysis& analysis, const Context& context) {
  if (analysis.device.backend->out_of_core() == nullptr || analysis.plan.tree.border > 0 || context.link != nullptr)
    return predicted_host_bytes(analysis, context);
  const Job job = job_of(analysis, {}, context);
  return analysis.bytes() + of_factor(analysis, context, [&]<class T>(device::Scalar<T>) {
           return least_left_for_disk<T>(analysis.device, job, 0, context);
         });
}

template <class T>
std::unique_ptr<device::Executor<T>> make_executor(const Analysis& analysis, const device::PivotRule& rule,
                                                   const Context& context) {
  const Backend& backend = *analysis.device.backend;
  Job job = job_of(analysis, rule, context);
  const auto& budgets = job.memory_bytes;
  const bool budgeted = std::any_of(budgets.begin(), budgets.end(), [](Offset b) { return b > 0; });
  try {
    return backend.make_executor(job, device::Scalar<T>());
  } catch (const Error& e) {
    if (e.status().code != StatusCode::out_of_memory) throw;
    if (analysis.plan.tree.border > 0) throw;  // out of core, what is left for it is not kept
    const bool fallback = backend.limits().own_memory || budgeted || !context.options.scratch.empty();
    if (backend.out_of_core() == nullptr || !fallback) throw;
  }
  const DeviceChoice& device = analysis.device;
  if (!device.one_a_rank) return make_out_of_core<T>(device, job, context);
  context.log(fmt::format("the {}s of the ranks lack memory: the first rank works out of core on those it sees",
                          backend.noun()));
  const auto own = static_cast<std::size_t>(context.link->rank());
  job.memory_bytes = context.link->all_numbers(job.memory_bytes[own]);  // each says what its device may take
  const auto make = [&](base::ThreadPool& pool) {
    return make_out_of_core_on_first_rank<T>(device, job, pool, context);
  };
  return make_first_rank_executor<T>(make, analysis.plan.tree.n, context);
}

#define ESPALIER_INSTANTIATE(T)                                                                          \
  template std::unique_ptr<device::Executor<T>> make_executor(const Analysis&, const device::PivotRule&, \
                                                              const Context&);
ESPALIER_FOR_SCALARS(ESPALIER_INSTANTIATE)
#undef ESPALIER_INSTANTIATE

}  // namespace espalier::solver
