#include "solver/options/option_text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <limits>

#include "plan/machine_model.hpp"
#include "solver/options/device_text.hpp"
#include "solver/options/option_check.hpp"

namespace espalier::solver {

namespace {

[[noreturn]] void reject(std::string_view what, std::string_view value, std::string_view expected) {
  throw Error(StatusCode::invalid_input, fmt::format("{}: '{}' is not understood; give {}", what, value, expected));
}

template <class T>
T parse_number(std::string_view key, std::string_view value, T least, T most, std::string_view expected) {
  T number{};
  const auto [end, error] = std::from_chars(value.data(), value.data() + value.size(), number);
  const bool whole = error == std::errc{} && end == value.data() + value.size();
  if (!whole || !(number >= least && number <= most)) reject(key, value, expected);
  return number;
}

bool parse_switch(std::string_view key, std::string_view value) {
  for (const std::string_view yes : {"1", "on", "true", "yes"}) {
    if (value == yes) return true;
  }
  for (const std::string_view no : {"0", "off", "false", "no"}) {
    if (value == no) return false;
  }
  reject(key, value, "on or off");
}

template <class T, std::size_t N>
T parse_name(std::string_view key, std::string_view value, const base::Named<T> (&rows)[N]) {
  std::string expected;
  for (std::size_t i = 0; i < N; ++i) {
    if (value == rows[i].name) return rows[i].value;
    expected += fmt::format("{}{}", i == 0 ? "" : (i + 1 == N ? " or " : ", "), rows[i].name);
  }
  reject(key, value, expected);
}

constexpr base::Named<Precision> kPrecisions[] = {
    {"fp64", Precision::fp64}, {"fp32", Precision::fp32}, {"mixed", Precision::mixed}, {"auto", Precision::automatic}};

using Setter = void (*)(Options&, std::string_view key, std::string_view value);
struct OptionText {
  std::string_view key;
  Setter set;
};

constexpr Index kMost = std::numeric_limits<Index>::max();

Offset parse_budget(std::string_view key, std::string_view value) {
  try {
    return parse_bytes(value);
  } catch (const Error& e) {
    throw Error(StatusCode::invalid_input, fmt::format("{}: {}", key, e.what()));
  }
}

void set_device(Options& options, std::string_view key, std::string_view value) {
  std::string near(value);  // as others write it: cuda, cuda:1, GPU
  std::transform(near.begin(), near.end(), near.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  if (near.starts_with("cuda")) near.replace(0, 4, "gpu");
  if (near == "gpu") near = "gpu:0";
  if (!is_device(std::string(value)))
    reject(key, value, is_device(near) ? fmt::format("'{}'; there are {}", near, kDeviceTexts) : kDeviceTexts);
  options.device = value;
}

// One budget for all devices, or one each, separated by commas.
void set_device_memory(Options& options, std::string_view key, std::string_view value) {
  std::vector<Offset> budgets;
  for (std::string_view rest = value;;) {
    const std::size_t comma = rest.find(',');
    budgets.push_back(parse_budget(key, rest.substr(0, comma)));
    if (comma == std::string_view::npos) break;
    rest.remove_prefix(comma + 1);
  }
  const bool one = budgets.size() == 1;
  options.device_memory_bytes = one ? budgets.front() : 0;
  options.device_memory_each_bytes = one ? std::vector<Offset>() : std::move(budgets);
}

void set_machine(Options& options, std::string_view, std::string_view value) {
  (void)plan::machine_with(value);
  options.machine = value;
}

constexpr base::Named<SingularMatrix> kSingular[] = {{"error", SingularMatrix::error},
                                                     {"report", SingularMatrix::report},
                                                     {"null_vectors", SingularMatrix::null_vectors}};

constexpr base::Named<Rescale> kRescale[] = {
    {"off", Rescale::off}, {"on", Rescale::on}, {"equilibration", Rescale::equilibration}};

constexpr std::array<OptionText, 22> kOptions{{
    {"kind", [](Options& o, std::string_view k, std::string_view v) { o.kind = parse_name(k, v, kKinds); }},
    {"precision",
     [](Options& o, std::string_view k, std::string_view v) { o.precision = parse_name(k, v, kPrecisions); }},
    {"device", set_device},
    {"device_memory", set_device_memory},
    {"host_memory",
     [](Options& o, std::string_view k, std::string_view v) { o.host_memory_bytes = parse_budget(k, v); }},
    {"pinned_memory",
     [](Options& o, std::string_view k, std::string_view v) { o.pinned_memory_bytes = parse_budget(k, v); }},
    {"scratch", [](Options& o, std::string_view, std::string_view v) { o.scratch = v; }},
    {"machine", set_machine},
    {"threads",
     [](Options& o, std::string_view k, std::string_view v) {
       o.threads = parse_number<int>(k, v, 0, kMostThreads, "a number of threads from 1 to 4096, or 0 for all cores");
     }},
    {"max_block_size",
     [](Options& o, std::string_view k, std::string_view v) {
       o.max_block_size = parse_number<Index>(k, v, 0, kMost, "a whole number of columns, or 0 for our choice");
     }},
    {"pivot_threshold",
     [](Options& o, std::string_view k, std::string_view v) {
       o.pivot_threshold = parse_number<double>(k, v, 0, 1, "a number from 0 to 1");
     }},
    {"perturbation",
     [](Options& o, std::string_view k, std::string_view v) {
       o.perturbation = parse_number<double>(k, v, 0, 1, "a number from 0 (our choice) to 1");
     }},
    {"singular", [](Options& o, std::string_view k, std::string_view v) { o.singular = parse_name(k, v, kSingular); }},
    {"zero_pivot",
     [](Options& o, std::string_view k, std::string_view v) {
       o.zero_pivot = parse_number<double>(k, v, 0, 1, "a number from 0 (our verdict) to 1");
     }},
    {"analyze_values",
     [](Options& o, std::string_view k, std::string_view v) { o.analyze_values = parse_switch(k, v); }},
    {"rescale", [](Options& o, std::string_view k, std::string_view v) { o.rescale = parse_name(k, v, kRescale); }},
    {"matching", [](Options& o, std::string_view k, std::string_view v) { o.matching = parse_switch(k, v); }},
    {"refinement_steps",
     [](Options& o, std::string_view k, std::string_view v) {
       o.refinement_steps = parse_number<int>(k, v, 0, 1000, "a whole number from 0 to 1000");
     }},
    {"refinement_target",
     [](Options& o, std::string_view k, std::string_view v) {
       o.refinement_target = parse_number<double>(k, v, 0, 1, "a number from 0 to 1");
     }},
    {"required_backward_error",
     [](Options& o, std::string_view k, std::string_view v) {
       constexpr const char* kExpected = "a number from 0 to 1, or inf: no error is too large";
       if (v == "inf" || v == "infinity")
         o.required_backward_error = std::numeric_limits<double>::infinity();
       else
         o.required_backward_error = parse_number<double>(k, v, 0, 1, kExpected);
     }},
    {"partial_refactorization",
     [](Options& o, std::string_view k, std::string_view v) { o.partial_refactorization = parse_switch(k, v); }},
    {"record_timeline",
     [](Options& o, std::string_view k, std::string_view v) { o.record_timeline = parse_switch(k, v); }},
}};

/// 1024 to this power for a unit; -1 for text that is no unit.
int power_of(std::string_view unit) {
  if (unit.empty()) return 0;
  std::string lower(unit);
  std::transform(lower.begin(), lower.end(), lower.begin(),
                 [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; });
  if (lower == "b") return 0;
  const std::size_t power = std::string_view("kmgt").find(lower[0]);
  const std::string_view rest = std::string_view(lower).substr(1);
  if (power == std::string_view::npos || !(rest.empty() || rest == "b" || rest == "ib")) return -1;
  return static_cast<int>(power) + 1;
}

}  // namespace

Offset parse_bytes(std::string_view text) {
  constexpr std::string_view expected = "a size such as 4096, 512M, 2GiB or 1.5G";
  double number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number, std::chars_format::fixed);
  if (error != std::errc{}) reject("size", text, expected);
  std::string_view unit = text.substr(at(end - text.data()));
  while (unit.starts_with(' ')) unit.remove_prefix(1);
  const int power = power_of(unit);
  const double bytes = std::ldexp(number, 10 * std::max(power, 0));
  // 2^62 leaves room for sums of budgets in 64 bits.
  if (power < 0 || !(bytes >= 0 && bytes <= std::ldexp(1.0, 62))) reject("size", text, expected);
  return static_cast<Offset>(bytes);
}

void set_option(Options& options, std::string_view key, std::string_view value) {
  std::string name(key);
  std::replace(name.begin(), name.end(), '-', '_');
  const auto* option =
      std::find_if(kOptions.begin(), kOptions.end(), [&](const OptionText& e) { return e.key == name; });
  if (option == kOptions.end()) {
    throw Error(StatusCode::invalid_input,
                fmt::format("there is no option '{}'; the options are {}", key, fmt::join(option_keys(), ", ")));
  }
  option->set(options, key, value);
}

std::vector<std::string_view> option_keys() {
  std::vector<std::string_view> keys;
  for (const OptionText& option : kOptions) keys.push_back(option.key);
  return keys;
}

std::string_view name_of(Kind kind) { return base::name_of(kKinds, kind); }

std::string_view name_of(Precision precision) { return base::name_of(kPrecisions, precision); }

std::string_view name_of(StatusCode code) {
  switch (code) {
    case StatusCode::ok:
      return "ok";
    case StatusCode::invalid_input:
      return "invalid_input";
    case StatusCode::singular:
      return "singular";
    case StatusCode::not_positive_definite:
      return "not_positive_definite";
    case StatusCode::out_of_memory:
      return "out_of_memory";
    case StatusCode::device_error:
      return "device_error";
    case StatusCode::accuracy_not_reached:
      return "accuracy_not_reached";
    case StatusCode::cancelled:
      return "cancelled";
  }
  return "unknown";
}

}  // namespace espalier::solver
