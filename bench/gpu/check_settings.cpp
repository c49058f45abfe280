#include "gpu/check_settings.hpp"

#include <CLI/CLI.hpp>

#include "gpu/gpu_case.hpp"

namespace espalier::bench {

Kind CheckSettings::kind() const { return kind_of(common.kind); }

std::vector<CheckSettings> CheckSettings::variants() const {
  std::vector<CheckSettings> list;
  for (const int count : counts) {
    list.push_back(*this);
    list.back().counts = {count};
    for (std::size_t k = 0; k < reuse.size(); ++k) {
      if (k > 0) list.push_back(list.back());
      list.back().tuning.reuse_distance = reuse[k];
    }
  }
  return list;
}

const std::vector<Floor>& floors() {
  static const std::vector<Floor> all = {
      {"elasticity 40", 52, 2.2},     {"elasticity 64", 400, 9},   {"elasticity 80", 1350, 21},
      {"plate 600", 110, 4.5},        {"plate 1200", 600, 19},     {"kkt 20", 6, 0.7},
      {"kkt 2", 1.5, 0.33},           {"kkt 400 10 8 8", 30, 2.2}, {"kkt 200 3 2 2", 0.5, 0.15},
      {"kkt 1000 2 1 1", 0.36, 0.12}, {"gyroscopic 48", 220, 3.8}};
  return all;
}

std::vector<Wish> wishes(const CheckSettings& settings) {
  std::vector<Wish> list;
  for (const std::string& name : settings.systems) list.push_back({name, settings.kind()});
  if (!list.empty()) return list;
  if (!settings.common.small) {
    for (const Floor& floor : floors()) list.push_back({floor.system, settings.kind()});
    return list;
  }
  const auto add = [&](std::initializer_list<const char*> names, std::initializer_list<Kind> kinds) {
    for (const char* name : names)
      for (const Kind kind : kinds)
        if (settings.kind() == Kind::automatic || settings.kind() == kind) list.push_back({name, kind});
  };
  add({"poisson 3", "poisson 9", "elasticity 2", "elasticity 6", "elasticity 10", "plate 30"},
      {Kind::llt, Kind::ldlt, Kind::lu});
  add({"kkt 2 3 2 2", "kkt 10 2 1 1", "kkt 3 6 4 4"}, {Kind::ldlt, Kind::lu});
  add({"gyroscopic 3", "gyroscopic 8"}, {Kind::lu});
  return list;
}

void declare(CLI::App& app, CheckSettings& settings, int argc, const char* const* argv) {
  declare_gpu_options(app, settings.common, argc, argv);
  device::cuda::DeviceTuning& tuning = settings.tuning;
  app.add_option("systems", settings.systems, "generators with their sizes, each in quotes: \"elasticity 40\"");
  app.add_flag("--host", settings.host, "compare with the host executor");
  app.add_flag("--lists", settings.lists, "with --plan: the tasks of every device");
  app.add_option("--columns", settings.columns, "right-hand sides")->check(CLI::PositiveNumber);
  declare_devices(app, settings.devices, settings.counts);
  app.add_flag("--staging", settings.staging, "between GPUs through pinned host memory");
  app.add_option("--patience", settings.patience, "seconds that a task waits for another before it gives up");
  app.add_option("--fail-device", settings.fail_device, "this device dies in mid-run");
  app.add_option("--delays", settings.delays, "nanoseconds a task, by device")->delimiter(',')->allow_extra_args(false);
  app.add_option("--times", settings.times, "write the times of all tasks to files of this name");
  app.add_option("--additional-subtrees", tuning.additional_subtrees, "beyond one per device");
  app.add_flag("--stealing", tuning.stealing, "devices take sub-trees of others");
  app.add_option("--speeds", tuning.device_speed, "relative, by device")->delimiter(',')->allow_extra_args(false);
  app.add_flag("--no-shared-top{false}", tuning.shared_top, "the first device alone does the top");
  app.add_flag("--count-balance", tuning.count_balance, "sub-trees dealt by unknowns instead of time");
  app.add_option("--reuse", settings.reuse, "in turn: tasks after which memory is used again")
      ->delimiter(',')
      ->check(CLI::PositiveNumber)
      ->allow_extra_args(false);
  app.add_option("--column-group", tuning.column_group, "block columns of the top dealt together, at most");
  app.add_option("--narrow", tuning.narrow_rows, "fronts of at most so many rows take narrow tiles");
  app.add_option("--group", tuning.group_entries, "entries of fronts that are one task together");
  const auto whole = [&tuning](const std::vector<int>& sizes) {
    tuning.whole_rows = sizes[0];
    tuning.whole_pivots = tuning.whole_pivots_ldlt = sizes[1];
  };
  app.add_option_function<std::vector<int>>("--whole", whole, "ROWS PIVOTS: fronts up to both are one task")
      ->expected(2);
}

}  // namespace espalier::bench
