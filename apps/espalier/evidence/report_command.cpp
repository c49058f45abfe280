/// \file
/// `espalier report`: files of results as one page or as Markdown.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>
#include <nlohmann/json.hpp>

#include "base/output_file.hpp"
#include "command.hpp"
#include "common/checked_options.hpp"
#include "common/terminal.hpp"
#include "evidence/page.hpp"
#include "matrix/file.hpp"
#include "measure/results.hpp"

namespace espalier::cli {

namespace {

struct ReportCommand {
  std::vector<std::string> files;
  std::string out_file, check_file;
  bool markdown = false;

  int run() const;
  [[nodiscard]] std::string make() const;
};

std::string ReportCommand::make() const {
  std::vector<measure::Results> all;
  for (const std::string& file : files) all.push_back(measure::read_results(file));
  try {
    measure::sort_results(all);
    return markdown ? evidence::markdown(all) : evidence::html_page(all);
  } catch (const nlohmann::json::exception& error) {  // says what was wanted and what was found
    throw Error(StatusCode::invalid_input, fmt::format("{}: a field has not the type that `espalier bench` writes: {}",
                                                       fmt::join(files, ", "), error.what()));
  }
}

int ReportCommand::run() const {
  for (const std::string& file : files) check_outputs({{"the results", file}}, {{"--out", out_file}});
  const std::string made = make();
  if (!check_file.empty()) {
    if (matrix::FileBytes(check_file).bytes() == made) return kSolved;
    throw Error(StatusCode::invalid_input,
                fmt::format("{} does not show these results; make it again with --out", check_file));
  }
  if (out_file.empty()) {
    print_result("{}", made);
    return kSolved;
  }
  base::OutputFile file(out_file);
  file.write(made);
  file.commit();
  print_result("{}: {} {} of results\n", out_file, files.size(), files.size() == 1 ? "file" : "files");
  return kSolved;
}

}  // namespace

void add_report(CLI::App& app, Action& action) {
  auto command = std::make_shared<ReportCommand>();
  CLI::App* sub = app.add_subcommand("report", "Make a page or Markdown tables of results of `espalier bench`");
  sub->add_option("results", command->files, "files of results")->required()->type_name("FILE...");
  CLI::Option* out = add_file(*sub, "--out", command->out_file, "file to write (default: standard output)");
  sub->add_flag("--markdown", command->markdown, "Markdown tables instead of a page");
  add_file(*sub, "--check", command->check_file, "write nothing; fail if this file is not what would be written")
      ->excludes(out);
  sub->callback([command, &action] { action = [command] { return command->run(); }; });
}

}  // namespace espalier::cli
