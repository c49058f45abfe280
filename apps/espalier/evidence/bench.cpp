/// \file
/// `espalier bench EXPERIMENT`: measures, prints tables, writes one file of results.
#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cctype>
#include <memory>
#include <nlohmann/json.hpp>

#include "command.hpp"
#include "common/checked_options.hpp"
#include "common/terminal.hpp"
#include "experiments/experiments.hpp"
#include "measure/machine.hpp"
#include "solver/options/option_text.hpp"
#include "solver/session/build_info.hpp"

namespace espalier::cli {

namespace {

/// The command line as it was typed, for the record.
std::string command_of(int argc, const char* const* argv) {
  std::string command = "espalier";
  for (int k = 1; k < argc; ++k) {
    const std::string text = argv[k];
    const char* quote = text.find_first_of(" +*?&;") == std::string::npos ? "" : "'";
    command += fmt::format(" {}{}{}", quote, text, quote);
  }
  return command;
}

/// Splits "a,b:c=gpu:0,1,d" at the commas that a name follows: a | b:c=gpu:0,1 | d.
std::vector<std::string> split_rivals(const std::vector<std::string>& texts) {
  std::vector<std::string> rivals;
  for (const std::string& text : texts) {
    std::size_t begin = 0;
    for (std::size_t k = 0; k <= text.size(); ++k) {
      const bool end = k == text.size();
      if (!end && !(text[k] == ',' && k + 1 < text.size() && std::isalpha(static_cast<unsigned char>(text[k + 1]))))
        continue;
      if (k > begin) rivals.push_back(text.substr(begin, k - begin));
      begin = k + 1;
    }
  }
  return rivals;
}

struct BenchCommand {
  const bench::Experiment* experiment = nullptr;
  bench::Settings settings;
  std::vector<std::string> rivals;
  std::string memory_limit;
  bool quick = false, json = false, no_ceilings = false;

  void add_to(CLI::App& sub);
  int run() const;
  [[nodiscard]] bench::Settings settled() const;
  [[nodiscard]] bench::Voice voice() const;
};

void BenchCommand::add_to(CLI::App& sub) {
  bench::Plan& plan = settings.plan;
  plan.threads = measure::usable_cores();
  const bool peers = std::string(experiment->name) == "peers";
  sub.add_option("--system", settings.systems,
                 "a generator (\"elasticity 20\"), a matrix file, or a folder of them; may be repeated")
      ->type_name("SPEC|FILE|DIR");
  sub.add_option("--rivals", rivals, "contestants, each with a variant after a colon (bench/README.md)")
      ->type_name("NAME[:VARIANT],...");
  if (*experiment->points != '\0') sub.add_option("--points", settings.points, experiment->points)->type_name("P...");
  if (peers) {
    sub.add_flag("--quick", quick, "small systems; ends within 5 minutes on 2 cores");
    sub.add_option("--set", settings.set, "systems and rivals of a table: quick, cpu (default), gpu or gpus")
        ->check(CLI::IsMember({"quick", "cpu", "gpu", "gpus"}));
  }
  sub.add_option("--kind", settings.kind, "auto (default), llt, ldlt or lu")
      ->check(CLI::IsMember({"auto", "llt", "ldlt", "lu"}));
  sub.add_option("--threads", plan.threads, "threads of every solver (default: all cores)")->check(positive());
  sub.add_option("-k,--repetitions", settings.repetitions,
                 "timed rounds after a warm-up (default: 5); 0: one factorization and solve, for what takes minutes")
      ->check(not_negative());
  sub.add_option("--analyses", settings.analyses, "rounds of analysis (default: 3)")->check(positive());
  sub.add_option("--rhs", plan.columns, "right-hand sides of the second solve (default: 32; 1: none)")
      ->check(positive());
  sub.add_option("--timeout", plan.child.timeout_seconds, "seconds that one call of a rival may take (default: 600)")
      ->check(positive());
  sub.add_option("--time", settings.time_seconds, "no system is begun after so many seconds")->check(positive());
  sub.add_option("--memory-limit", memory_limit, "memory that a rival's process may take, such as 8GiB")
      ->type_name("SIZE");
  sub.add_option("--wrong-above", plan.wrong_above, "a larger normwise backward error is a wrong answer (1e-8)")
      ->check(positive());
  sub.add_flag("--cold{false}", plan.warm, "time a turn's first call, with the caches as the others left them");
  sub.add_flag("--one-at-a-time", plan.one_at_a_time, "one process after the other, for systems that fill the memory");
  sub.add_flag("--no-ceilings", no_ceilings, "do not measure the machine's ceilings first");
  add_file(sub, "--out", settings.out, fmt::format("file of results (default: bench-{}.json)", experiment->name));
  sub.add_flag("--json", json, "print the results as JSON instead of the tables");
}

bench::Settings BenchCommand::settled() const {
  bench::Settings s = settings;
  s.rivals = split_rivals(rivals);
  s.ceilings = !no_ceilings;
  s.version = solver::version();
  if (s.out.empty()) s.out = fmt::format("bench-{}.json", experiment->name);
  if (!memory_limit.empty()) s.plan.child.memory_limit_bytes = solver::parse_bytes(memory_limit);
  if (!quick && s.set != "quick") return s;
  // The limits are a third of the five minutes each for rounds and time-outs of a slow rival on a busy machine.
  s.set = "quick";
  if (!s.repetitions) s.repetitions = 3;
  if (s.analyses == 0) s.analyses = 2;
  if (s.time_seconds == 0) s.time_seconds = 180;
  s.plan.child.timeout_seconds = std::min(s.plan.child.timeout_seconds, 30.0);
  return s;
}

bench::Voice BenchCommand::voice() const {
  bench::Voice voice;
  if (isatty(STDERR_FILENO) != 0)
    voice.progress = [](const std::string& what) {
      print_note("\r\033[K{}", what);
      std::fflush(stderr);
    };
  if (!json)
    voice.print = [](const std::string& text) {
      print_result("{}", text);
      std::fflush(stdout);
    };
  return voice;
}

int BenchCommand::run() const {
  bench::Settings chosen = settled();
  check_outputs({}, {{"--out", chosen.out}});
  bench::Bench session(experiment->name, std::move(chosen), voice());
  experiment->run(session);
  session.save();
  if (json)
    print_result("{}\n", session.document().dump(1, ' ', false, nlohmann::json::error_handler_t::replace));
  else
    print_result("results: {}\n", session.settings().out);
  if (!session.unreadable().empty())
    throw Error(StatusCode::invalid_input,
                fmt::format("--system: could be neither made nor read: {} (the others were measured; why stands in {})",
                            fmt::join(session.unreadable(), ", "), session.settings().out));
  return kSolved;
}

}  // namespace

void add_bench(CLI::App& app, int argc, const char* const* argv, Action& action) {
  CLI::App* sub = app.add_subcommand("bench", "Measure: rivals, sweeps, scaling, growth, ceilings");
  sub->require_subcommand(1);
  sub->footer("Results are one JSON file; `espalier report FILE... --out report.html` makes a page of it.");
  for (const bench::Experiment& experiment : bench::experiments()) {
    auto command = std::make_shared<BenchCommand>();
    command->experiment = &experiment;
    command->settings.command = command_of(argc, argv);
    CLI::App* one = sub->add_subcommand(experiment.name, experiment.description);
    command->add_to(*one);
    one->callback([command, &action] { action = [command] { return command->run(); }; });
  }
}

}  // namespace espalier::cli
