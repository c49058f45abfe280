#include "solver/options/device_choice.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <span>

#include "solver/analysis/real_form.hpp"
#include "solver/options/device_text.hpp"

namespace espalier::solver {

namespace {

constexpr double kGainOfDevice = 0.9;  // another device must bring the predicted time below this part of it

DeviceChoice devices_of(const device::Backend& backend, const device::FoundDevices& found, std::vector<int> numbers,
                        std::string reason) {
  DeviceChoice choice;
  choice.backend = &backend;
  const std::string& first = found.names[at(numbers.front())];
  choice.unequal =
      std::any_of(numbers.begin(), numbers.end(), [&](int number) { return found.names[at(number)] != first; });
  choice.numbers = std::move(numbers);
  choice.reason = std::move(reason);
  return choice;
}

std::vector<int> first_devices(int count) {
  std::vector<int> numbers(at(count));
  std::iota(numbers.begin(), numbers.end(), 0);
  return numbers;
}

DeviceChoice host_devices_asked_for(const device::Registry& registry, int devices) {
  DeviceChoice choice;
  choice.backend = &registry.host();
  choice.numbers = first_devices(devices);
  choice.reason = fmt::format("{} {}{}: asked for", devices, registry.host().noun(), devices == 1 ? "" : "s");
  return choice;
}

// The devices that were asked for by number; none: all.
DeviceChoice asked_for(const DeviceText& text, const device::Registry& registry) {
  const device::Backend* backend = registry.find(text.backend);
  if (backend == nullptr)
    throw Error(StatusCode::device_error,
                fmt::format("no {} can be used: {}", text.backend, registry.find_left_out(text.backend)->reason));
  const device::FoundDevices found = backend->find();
  const std::string_view noun = backend->noun();
  if (found.names.empty())
    throw Error(StatusCode::device_error, fmt::format("no {} can be used: {}", noun, found.reason));
  const auto count = static_cast<int>(found.names.size());
  std::vector<int> numbers = text.numbers;
  if (numbers.empty()) numbers = first_devices(std::min(count, backend->limits().most_devices));
  for (const int number : numbers)
    if (number >= count)
      throw Error(StatusCode::device_error,
                  fmt::format("{} {} was asked for, but this machine has {}", noun, number, count));
  if (static_cast<int>(numbers.size()) > backend->limits().most_devices)
    throw Error(StatusCode::invalid_input,
                fmt::format("at most {} {}s can share a factorization", backend->limits().most_devices, noun));
  std::string reason =
      numbers.size() == 1 ? fmt::format("{}: asked for", noun) : fmt::format("{} {}s: asked for", numbers.size(), noun);
  return devices_of(*backend, found, std::move(numbers), std::move(reason));
}

DeviceChoice named(const DeviceText& text, const device::Registry& registry) {
  if (text.whole_host) return whole_host(registry, "host: asked for");
  if (text.hosts) return host_devices_asked_for(registry, text.hosts->devices);
  return asked_for(text, registry);
}

// A backend without complex numbers takes the real form.
device::PredictedTime predicted(const device::Backend& backend, const analysis::AssemblyTree& tree,
                                const device::PlanWish& wish) {
  if (!wish.complex || backend.limits().complex) return backend.predict(tree, wish);
  device::PlanWish real = wish;
  real.complex = false;
  return backend.predict(doubled(tree), real);
}

// What is known of a backend that could be faster than the host.
struct Candidate {
  const device::Backend* backend = nullptr;
  device::FoundDevices found;
  device::PredictedTime time;
};

// Backends with devices, other than the host's, and why others have none.
std::vector<Candidate> candidates(const device::Registry& registry, const analysis::AssemblyTree& tree,
                                  const device::PlanWish& wish, std::string& why_none) {
  std::vector<Candidate> list;
  const auto note = [&](std::string_view reason) {
    why_none += why_none.empty() ? "" : "; ";
    why_none += reason;
  };
  for (const device::Backend* backend : registry.backends) {
    if (backend == &registry.host()) continue;
    Candidate c{backend, {}, predicted(*backend, tree, wish)};
    if (std::isinf(c.time.on(1))) continue;
    c.found = backend->find();
    if (c.found.names.empty())
      note(c.found.reason);
    else
      list.push_back(std::move(c));
  }
  for (const device::LeftOut& l : registry.left_out) note(l.reason);
  return list;
}

DeviceChoice automatic(const device::Registry& registry, const analysis::AssemblyTree& tree,
                       const device::PlanWish& wish, std::size_t budgets) {
  std::string why_none;
  const std::vector<Candidate> list = candidates(registry, tree, wish, why_none);
  DeviceChoice best = whole_host(registry, "host: " + why_none);
  double seconds = registry.host().predict(tree, wish).on(1);
  const double on_host = seconds;
  for (const Candidate& c : list) {
    int most = std::min(static_cast<int>(c.found.names.size()), c.backend->limits().most_devices);
    if (budgets > 0) most = std::min(most, static_cast<int>(budgets));
    const int count = fastest_count(c.time, most);
    const std::string figures =
        fmt::format("predicted {:.2g} s on {} of {} {}{}, {:.2g} s on the host", c.time.on(count), count, most,
                    c.backend->noun(), most == 1 ? "" : "s", on_host);
    if (c.time.on(count) < seconds) {
      seconds = c.time.on(count);
      best = devices_of(*c.backend, c.found, first_devices(count), fmt::format("{}: {}", c.backend->noun(), figures));
    } else if (best.backend == &registry.host()) {
      best.reason = "host: " + figures;
    }
  }
  best.ours = true;
  return best;
}

// How many ranks of this one's machine come before it.
std::size_t place_on_machine(const ranks::Communicator& link) {
  const auto& hosts = link.hosts();
  const auto me = hosts.begin() + link.rank();
  return static_cast<std::size_t>(std::count(hosts.begin(), me, *me));
}

bool is_one_machine(const ranks::Communicator& link) {
  const auto& hosts = link.hosts();
  return std::all_of(hosts.begin(), hosts.end(), [&](const std::string& host) { return host == hosts.front(); });
}

DeviceChoice choice_of_ranks(const device::Backend& backend, const std::vector<std::int64_t>& numbers,
                             std::string_view why) {
  DeviceChoice choice;
  choice.backend = &backend;
  choice.numbers.assign(numbers.begin(), numbers.end());
  choice.one_a_rank = true;
  choice.reason = fmt::format("{} ranks, a {} each: {}", numbers.size(), backend.noun(), why);
  return choice;
}

constexpr double kSlow = 0.25;  // a device below this part of the fastest makes its blocks of the top too late for all

// Rounded, so that equal devices get equal parts in every run.
double rounded_speed(double flops, double best) {
  constexpr double kSteps = 8;
  return std::max(1.0, std::round(kSteps * flops / best)) / kSteps;
}

// How fast the devices of ranks are, where they are not all of one kind: each rank measures its own. None can be left
// out. Collective.
void measure_unequal(DeviceChoice& choice, ranks::Communicator& link) {
  const int number = choice.numbers[at(link.rank())];
  std::string mine;
  link.expect_all([&] { mine = choice.backend->find().names.at(at(number)); });
  const auto names = link.all_gather(std::as_bytes(std::span(mine)));
  if (std::count(names.begin(), names.end(), names.front()) == link.size()) return;
  double flops = 0;
  link.expect_all([&] {
    choice.backend->open({number});
    const device::DeviceRates rates = choice.backend->measure(number);
    if (!rates.refused.empty() || !(rates.flops > 0))
      throw Error(StatusCode::device_error,
                  fmt::format("its {} {} cannot be used: {}", choice.backend->noun(), number, rates.refused));
    flops = rates.flops;
  });
  std::vector<double> all;
  for (const auto& of_rank : link.all_gather_of(std::span<const double>(&flops, 1))) all.push_back(of_rank.at(0));
  const double best = *std::max_element(all.begin(), all.end());
  for (std::size_t r = 0; r < all.size(); ++r) {
    choice.speed.push_back(rounded_speed(all[r], best));
    if (all[r] < kSlow * best)
      choice.notice += fmt::format("{}the {} of {} has {:.0f} % of the speed of the fastest: the others wait for it",
                                   choice.notice.empty() ? "" : "; ", choice.backend->noun(),
                                   link.name_of(static_cast<int>(r)), 100 * all[r] / best);
  }
}

// A device for each rank where all are on one machine that has enough, and the machine model expects them to be faster
// than the hosts. Rank 0 decides. Collective.
DeviceChoice automatic_of_ranks(const device::Registry& registry, const analysis::AssemblyTree& tree,
                                const device::PlanWish& wish, ranks::Communicator& link) {
  DeviceChoice hosts = whole_host(registry, fmt::format("the hosts of {} ranks", link.size()));
  if (!is_one_machine(link)) return hosts;
  const double on_hosts = registry.host().predict(tree, wish).on(1) / link.size();
  const std::size_t place = place_on_machine(link);
  for (const device::Backend* backend : registry.backends) {  // the same on all ranks
    const device::Limits& limits = backend->limits();
    if (!limits.ranks || !limits.own_memory || link.size() > limits.most_devices) continue;
    const double seconds = predicted(*backend, tree, wish).on(link.size());
    const bool good = place < backend->find().names.size() && (link.rank() != 0 || seconds < on_hosts);
    const auto numbers = link.all_numbers(good ? static_cast<std::int64_t>(place) : -1);
    if (std::find(numbers.begin(), numbers.end(), -1) != numbers.end()) continue;
    DeviceChoice choice =
        choice_of_ranks(*backend, numbers, fmt::format("predicted {:.2g} s, {:.2g} s on the hosts", seconds, on_hosts));
    choice.ours = true;
    measure_unequal(choice, link);
    return choice;
  }
  return hosts;
}

std::vector<device::DeviceRates> measured(const DeviceChoice& choice) {
  choice.backend->open(choice.numbers);
  std::vector<device::DeviceRates> rates;
  for (const int number : choice.numbers) rates.push_back(choice.backend->measure(number));
  return rates;
}

}  // namespace

DeviceChoice whole_host(const device::Registry& registry, std::string reason) {
  DeviceChoice choice;
  choice.backend = &registry.host();
  choice.reason = std::move(reason);
  choice.budgeted = false;
  return choice;
}

int fastest_count(const device::PredictedTime& time, int most) {
  int best = 1;
  for (int count = 2; count <= most; ++count)
    if (time.on(count) < kGainOfDevice * time.on(best)) best = count;
  return best;
}

DeviceChoice leave_out(DeviceChoice choice, const std::vector<device::DeviceRates>& rates) {
  double best = 0, copy = 0;
  for (const auto& r : rates) {
    if (!r.refused.empty()) continue;
    best = std::max(best, r.flops);
    copy = std::max(copy, r.copy_bytes);
  }
  DeviceChoice kept = choice;
  kept.numbers.clear();
  for (std::size_t k = 0; k < rates.size(); ++k) {
    const double speed = best > 0 ? rates[k].flops / best : 0;
    const bool refused = !rates[k].refused.empty();
    if (refused || speed < kSlow) {
      kept.notice += fmt::format(
          "{}{} {} is left out: {}", kept.notice.empty() ? "" : "; ", choice.backend->noun(), choice.numbers[k],
          refused ? rates[k].refused : fmt::format("it has {:.0f} % of the speed of the fastest", 100 * speed));
      continue;
    }
    kept.numbers.push_back(choice.numbers[k]);
    kept.places.push_back(k);
    kept.speed.push_back(rounded_speed(rates[k].flops, best));
  }
  kept.reason += fmt::format("; measured {:.1f} TFLOP/s and {:.1f} TB/s on the fastest", 1e-12 * best, 1e-12 * copy);
  if (kept.numbers.empty())
    throw Error(StatusCode::device_error, fmt::format("no {} can be used: {}", choice.backend->noun(), kept.notice));
  if (std::all_of(kept.speed.begin(), kept.speed.end(), [](double s) { return s == 1; }))
    kept.speed.clear();
  else
    kept.unequal = true;
  return kept;
}

std::optional<DeviceChoice> named_devices(const std::string& device, const device::Registry& registry) {
  const auto text = read_device(device, registry);
  if (!text || text->automatic) return std::nullopt;
  try {
    return named(*text, registry);
  } catch (const Error&) {
    return std::nullopt;
  }
}

DeviceChoice choose_device(const Options& options, const device::Registry& registry, const analysis::AssemblyTree& tree,
                           const device::PlanWish& wish) {
  const auto text = read_device(options.device, registry);
  if (!text)
    throw Error(StatusCode::invalid_input,
                fmt::format("device '{}' is not known; use {}", options.device, kDeviceTexts));
  const std::size_t budgets = options.device_memory_each_bytes.size();
  DeviceChoice choice = text->automatic ? automatic(registry, tree, wish, budgets) : named(*text, registry);
  if (text->hosts && wish.threads < text->hosts->devices)
    throw Error(
        StatusCode::out_of_memory,
        fmt::format("device {} takes a thread for each of its devices, and the system gives {} of them; ask for "
                    "fewer devices, or raise its limits (ulimit -u, ulimit -v)",
                    options.device, wish.threads));
  if (budgets > 0 && choice.budgeted && !choice.ours && static_cast<int>(budgets) != choice.devices())
    throw Error(StatusCode::invalid_input,
                fmt::format("{} budgets of device memory for {} device{}: give one for all, or one for each", budgets,
                            choice.devices(), choice.devices() == 1 ? "" : "s"));
  if (choice.devices() == 1 || !choice.backend->limits().own_memory) return choice;
  const auto rates = measured(choice);
  return leave_out(std::move(choice), rates);
}

std::optional<int> own_device(const Options& options, const device::Registry& registry,
                              const ranks::Communicator& link) {
  const auto text = read_device(options.device, registry);
  if (!text)
    throw Error(StatusCode::invalid_input,
                fmt::format("device '{}' is not known; use {}", options.device, kDeviceTexts));
  if (text->automatic || text->whole_host) return std::nullopt;
  const device::Backend* backend = registry.find(text->backend);
  if (text->hosts || (backend != nullptr && !backend->limits().ranks))
    throw Error(StatusCode::device_error,
                fmt::format("device '{}' cannot be shared by {} ranks: use cpu, or gpu:all for one GPU a rank",
                            options.device, link.size()));
  const std::vector<int> numbers = asked_for(*text, registry).numbers;
  return numbers[place_on_machine(link) % numbers.size()];
}

DeviceChoice device_of_ranks(const Options& options, const device::Registry& registry, ranks::Communicator& link,
                             const analysis::AssemblyTree& tree, const device::PlanWish& wish) {
  std::optional<int> mine;
  link.expect_all([&] { mine = own_device(options, registry, link); });
  const std::vector<std::int64_t> numbers = link.all_numbers(mine.value_or(-1));
  for (std::size_t r = 0; r < numbers.size(); ++r)
    if ((numbers[r] < 0) != (numbers[0] < 0))
      throw Error(StatusCode::invalid_input, fmt::format("{} and {} name different devices: give all ranks the same",
                                                         link.name_of(0), link.name_of(static_cast<int>(r))));
  if (!mine) {
    const bool automatic = read_device(options.device, registry)->automatic;
    const auto wishes = link.all_numbers(automatic ? 1 : 0);
    if (std::find(wishes.begin(), wishes.end(), 0) == wishes.end())
      return automatic_of_ranks(registry, tree, wish, link);
    return whole_host(registry, fmt::format("the hosts of {} ranks", link.size()));
  }
  const device::Backend* backend = registry.find(read_device(options.device, registry)->backend);
  if (link.size() > backend->limits().most_devices)
    throw Error(StatusCode::invalid_input, fmt::format("at most {} ranks can share a factorization on {}s",
                                                       backend->limits().most_devices, backend->noun()));
  DeviceChoice choice = choice_of_ranks(*backend, numbers, "asked for");
  measure_unequal(choice, link);
  return choice;
}

std::optional<DeviceChoice> take_over(const DeviceChoice& failed, const std::string& why,
                                      const device::Registry& registry) {
  if (!failed.ours || failed.backend == &registry.host()) return std::nullopt;
  DeviceChoice next = whole_host(registry, "the host: " + why);
  if (failed.devices() > 1 && !failed.one_a_rank) {
    next = DeviceChoice{};
    next.backend = failed.backend;
    next.numbers = {failed.numbers.front()};
    next.reason = fmt::format("one {}: {}", failed.backend->noun(), why);
    next.places = {failed.places.empty() ? 0 : failed.places.front()};
  }
  next.ours = true;
  return next;
}

std::vector<Offset> budgets_of(const DeviceChoice& choice, const Options& options) {
  const auto count = choice.numbers.size();
  if (!choice.budgeted) return std::vector<Offset>(count, 0);
  const std::vector<Offset>& each = options.device_memory_each_bytes;
  std::vector<Offset> list(count, options.device_memory_bytes);
  for (std::size_t d = 0; d < count && !each.empty(); ++d)
    list[d] = each[std::min(choice.places.empty() ? d : choice.places[d], each.size() - 1)];
  return list;
}

}  // namespace espalier::solver
