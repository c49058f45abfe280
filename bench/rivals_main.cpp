/// \file
/// espalier_bench_rivals: every solver on the same matrix in the same run.
#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>

#include "rivals/machine.hpp"
#include "rivals/session.hpp"
#include "rivals/systems.hpp"
#include "rivals/table.hpp"

namespace espalier::bench {
namespace {

/// What the command line says.
struct Arguments {
  std::vector<std::string> systems, rivals = {"espalier", "pardiso", "cholmod", "mumps", "eigen", "cudss"};
  std::string kind = "auto", json;
  Plan plan;
  double memory_gib = 0;
};

void declare(CLI::App& app, Arguments& arguments) {
  Plan& plan = arguments.plan;
  plan.threads = usable_cores();
  app.add_option("--system,system", arguments.systems,
                 "A generator with its sizes (\"elasticity 20 20 20\") or a matrix file; may be repeated")
      ->required()
      ->allow_extra_args(false);
  app.add_option("--rivals", arguments.rivals,
                 "Names separated by commas, each with a variant after a colon (cudss:hybrid=4096+deterministic)")
      ->delimiter(',')
      ->capture_default_str();
  app.add_option("--kind", arguments.kind, "auto, llt, ldlt or lu")
      ->check(CLI::IsMember({"auto", "llt", "ldlt", "lu"}))
      ->capture_default_str();
  app.add_option("--threads", plan.threads, "Threads of every solver")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  app.add_option("--repetitions,-k", plan.repetitions, "Timed rounds of refactorization and solves, after a warm-up")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  app.add_option("--analyses", plan.analyses, "Rounds of analysis")->check(CLI::PositiveNumber)->capture_default_str();
  app.add_option("--rhs", plan.columns, "Right-hand sides of the second solve; 1: no second solve")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  app.add_option("--timeout", plan.child.timeout_seconds, "Seconds that one call of a rival may take")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  app.add_option("--memory-limit", arguments.memory_gib, "GiB of memory that a rival's process may take; 0: no limit")
      ->check(CLI::NonNegativeNumber);
  app.add_option("--wrong-above", plan.wrong_above, "A normwise backward error above it is a wrong answer")
      ->capture_default_str();
  app.add_flag("--one-at-a-time", plan.one_at_a_time, "One rival after the other, for systems that fill the memory");
  app.add_option("--json", arguments.json, "Write everything, all samples included, to this file");
}

/// The folder of this program; plug-ins and host lie in its sub-folder rivals.
std::string own_folder() { return std::filesystem::read_symlink("/proc/self/exe").parent_path().string(); }

void show_progress(const std::string& what) {
  if (isatty(STDERR_FILENO)) std::cerr << "\r\033[K" << what << std::flush;
}

nlohmann::json run_system(const std::string& words, const Arguments& arguments) {
  const SparseMatrix a = make_system(words);
  Plan plan = arguments.plan;
  plan.kind = kind_named(arguments.kind);
  if (plan.kind == Kind::automatic) plan.kind = automatic_kind(a);
  std::cout << fmt::format("{}: {} unknowns, {} entries, {}, {} threads, medians of {}\n", words, a.rows, a.nonzeros(),
                           kind_name(plan.kind), plan.threads, plan.repetitions)
            << std::flush;
  const std::vector<Row> rows = compare(a, plan, show_progress);
  show_progress("");
  std::cout << text_table(rows, plan.columns) << std::endl;
  nlohmann::json record = {{"system", words},
                           {"rows", a.rows},
                           {"nonzeros", a.nonzeros()},
                           {"kind", kind_name(plan.kind)},
                           {"rivals", nlohmann::json::array()}};
  for (const Row& row : rows) record["rivals"].push_back(row_record(row));
  return record;
}

nlohmann::json settings_record(const Plan& plan) {
  return {{"threads", plan.threads},
          {"repetitions", plan.repetitions},
          {"analyses", plan.analyses},
          {"right_hand_sides", plan.columns},
          {"one_at_a_time", plan.one_at_a_time},
          {"wrong_above", plan.wrong_above},
          {"timeout_seconds", plan.child.timeout_seconds},
          {"memory_limit_bytes", plan.child.memory_limit_bytes},
          {"environment", plan.child.environment}};
}

/// Says so where other programs take the cores: the figures are theirs as much as the rivals'.
void warn_of_load(const nlohmann::json& machine) {
  const double load = machine.at("load_average_before");
  if (load > 0.25 * machine.at("cores").get<double>())
    std::cout << fmt::format("Note: load average {:.1f} before the start; wall-clock times are disturbed.\n\n", load);
}

int run(Arguments& arguments, const std::string& command) {
  Plan& plan = arguments.plan;
  plan.rivals = arguments.rivals;
  plan.child.folder = own_folder() + "/rivals";
  plan.child.environment = rival_environment(plan.threads);
  plan.child.memory_limit_bytes = static_cast<Offset>(arguments.memory_gib * 1073741824.0);
  nlohmann::json record = {
      {"program", "espalier_bench_rivals"}, {"command", command},          {"date", utc_now()},
      {"commit", source_commit()},          {"machine", machine_record()}, {"settings", settings_record(plan)},
      {"systems", nlohmann::json::array()}};
  warn_of_load(record["machine"]);
  for (const std::string& words : arguments.systems) record["systems"].push_back(run_system(words, arguments));
  if (arguments.json.empty()) return 0;
  std::ofstream file(arguments.json);
  file << record.dump(1) << '\n';
  if (!file.flush()) throw Error(StatusCode::invalid_input, arguments.json + " cannot be written");
  return 0;
}

}  // namespace
}  // namespace espalier::bench

int main(int count, char** texts) {
  CLI::App app("Every solver on the same matrix in the same run: analysis, refactorization, solve, memory, error.");
  espalier::bench::Arguments arguments;
  espalier::bench::declare(app, arguments);
  try {
    app.parse(count, texts);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  std::string command;
  for (int k = 0; k < count; ++k) {
    const std::string text = texts[k];
    const std::string quote = text.find(' ') == std::string::npos ? "" : "'";
    command += (k == 0 ? "" : " ") + quote + text + quote;
  }
  try {
    return espalier::bench::run(arguments, command);
  } catch (const std::exception& error) {
    std::cerr << "espalier_bench_rivals: " << error.what() << '\n';
    return 2;
  }
}
