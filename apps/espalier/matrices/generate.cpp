/// \file
/// `espalier generate`: a mechanical system of any size, written to a file.
#include "matrix/generators/generate.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>
#include <nlohmann/json.hpp>

#include "command.hpp"
#include "common/checked_options.hpp"
#include "common/terminal.hpp"
#include "matrix/binary.hpp"
#include "matrix/matrix_market.hpp"

namespace espalier::cli {

namespace {

struct GenerateCommand {
  std::vector<std::string> words;
  std::string out_file;
  std::uint64_t seed = 1;
  bool natural = false, json = false, quiet = false;

  int run() const;
};

void write_matrix(const std::string& path, const SparseMatrix& a, const std::string& name, base::ThreadPool& pool) {
  if (path.ends_with(".esp")) {
    matrix::write_binary(path, a);
  } else {
    matrix::write_matrix_market(path, a, fmt::format("espalier generate {}", name), &pool);
  }
}

void check_name(const std::string& path) {
  for (const char* known : {".mtx", ".mtx.gz", ".esp"})
    if (path.ends_with(known)) return;
  throw Error(StatusCode::invalid_input,
              fmt::format("--out {}: the name must end in .mtx, .mtx.gz (Matrix Market) or .esp (binary)", path));
}

int GenerateCommand::run() const {
  auto spec = matrix::parse_generator(words);
  spec.seed = seed;
  if (natural) spec.numbering = matrix::Numbering::natural;
  check_name(out_file);
  check_outputs({}, {{"--out", out_file}});
  base::ThreadPool pool(base::available_cores());
  const SparseMatrix a = matrix::generate(spec, &pool);
  const std::string name = matrix::describe(spec);
  write_matrix(out_file, a, name, pool);
  if (json) {
    const nlohmann::ordered_json report = {{"generator", name},        {"seed", seed},
                                           {"file", out_file},         {"rows", a.rows},
                                           {"nonzeros", a.nonzeros()}, {"symmetric", a.symmetric()}};
    print_result("{}\n", report.dump(2));
  } else if (!quiet) {
    print_result("{}: {} unknowns, {} entries, {}\n", out_file, grouped(a.rows), grouped(a.nonzeros()),
                 a.symmetric() ? "symmetric" : "unsymmetric");
  }
  return kSolved;
}

}  // namespace

void add_generate(CLI::App& app, Action& action) {
  auto command = std::make_shared<GenerateCommand>();
  CLI::App* sub = app.add_subcommand("generate", "Write a mechanical system of any size to a file");
  sub->add_option("system", command->words, "the system and its sizes, see below")->required()->type_name("SPEC...");
  add_file(*sub, "--out", command->out_file, "file to write: .mtx, .mtx.gz or .esp")->required();
  sub->add_option("--seed", command->seed, "seed of numbering and element factors (default: 1)")
      ->type_name("N")
      ->check(whole_number());
  sub->add_flag("--natural", command->natural, "number the unknowns in grid order, not at random");
  sub->add_flag("--json", command->json, "say what was written as JSON");
  sub->add_flag("-q,--quiet", command->quiet, "print nothing but errors");
  sub->footer("Systems:\n" + matrix::generator_usage());
  sub->callback([command, &action] { action = [command] { return command->run(); }; });
}

}  // namespace espalier::cli
