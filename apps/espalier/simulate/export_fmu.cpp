/// \file
/// `espalier export-fmu`: a model as a functional mock-up unit for other simulators.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "command.hpp"
#include "common/checked_options.hpp"
#include "common/terminal.hpp"
#include "espalier/fmu.hpp"
#include "solve/report.hpp"

namespace espalier::cli {

namespace {

struct ExportFmuCommand {
  std::string model, out;
  FmuOptions options;
  bool quiet = false, json = false;

  int run() const;
};

void print_json(const FmuResult& r) {
  nlohmann::ordered_json out = {{"path", r.path}, {"bytes", r.bytes}, {"files", r.files}};
  for (const FmuVariable& v : r.variables)
    out["variables"].push_back({{"name", v.name}, {"kind", v.kind}, {"unit", v.unit}, {"start", v.start}});
  out["model_exchange"] = r.model_exchange;
  out["no_model_exchange"] = r.no_model_exchange;
  print_result("{}\n", to_text(out));
}

int ExportFmuCommand::run() const {
  std::string path = out;
  if (path.empty()) path = std::filesystem::path(model).replace_extension(".fmu").string();
  check_outputs({{"the model", model}}, {{"--out", path}});
  const FmuResult result = export_fmu(model, path, options);
  if (!result.status.ok()) throw Error(result.status);
  if (json) print_json(result);
  if (quiet || json) return kSolved;
  print_result("wrote {}: FMI {}, {:.1f} MB, co-simulation{}\n", result.path, options.version,
               static_cast<double>(result.bytes) / 1e6, result.model_exchange ? " and model exchange" : "");
  for (const FmuVariable& v : result.variables)
    if (v.kind == "input" || v.kind == "output" || v.kind == "parameter")
      print_result("  {:<9} {}{}{}\n", v.kind, v.name, v.kind == "output" ? "" : fmt::format(" = {:g}", v.start),
                   v.unit.empty() ? "" : " " + v.unit);
  for (const std::string& file : result.files) print_result("  holds     {}\n", file);
  if (!result.model_exchange) print_note("no model exchange: {}\n", result.no_model_exchange);
  return kSolved;
}

}  // namespace

void add_export_fmu(CLI::App& app, Action& action) {
  auto command = std::make_shared<ExportFmuCommand>();
  FmuOptions& o = command->options;
  CLI::App* sub = app.add_subcommand("export-fmu", "A model as an FMU for other simulators (docs/guide/fmi.md)");
  add_file(*sub, "model", command->model, "the model, TOML")->required();
  add_file(*sub, "--out", command->out, "the FMU (default: the model's name with the end .fmu)");
  sub->add_option("--fmi", o.version, "version of the standard (default 3)")->check(CLI::IsMember({2, 3}));
  const auto names = [&](const char* option, std::vector<std::string>& list, const char* help) {
    sub->add_option(option, list, help)->type_name("NAME,...")->delimiter(',')->take_all()->allow_extra_args(false);
  };
  names("--inputs", o.inputs, "of the model's [inputs] (default: all)");
  names("--outputs", o.outputs, "quantities, for instance hinge.angle,bob.position (default: those of [output])");
  names("--parameters", o.parameters,
        "names of [parameters], or paths of other numbers, bodies.bob.mass (default: all numbers in [parameters])");
  sub->add_option("--set", o.set, "replace a value of the model for good; may be repeated")
      ->type_name("PATH=VALUE")
      ->take_all()
      ->allow_extra_args(false);
  add_file(*sub, "--library", o.library, "espalier_fmu.so, where it is not found by itself");
  sub->add_flag("--json", command->json, "print as JSON");
  sub->add_flag("-q,--quiet", command->quiet, "print nothing but errors");
  sub->callback([command, &action] { action = [command] { return command->run(); }; });
}

}  // namespace espalier::cli
