/// \file
/// `espalier reduce`: a flexible body of a model as reduced matrices for other programs.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <memory>

#include "command.hpp"
#include "common/checked_options.hpp"
#include "common/stop_signals.hpp"
#include "common/terminal.hpp"
#include "espalier/reduced_matrices.hpp"

namespace espalier::cli {

namespace {

struct ReduceCommand {
  std::string model, out;
  ReducedMatricesOptions what;
  ReducedFiles files;
  SimulationOptions options;
  bool quiet = false;

  int run();
};

int ReduceCommand::run() {
  if (!files.op4 && !files.op4_text && !files.dmig && !files.mtx && !files.npz)
    throw Error(StatusCode::invalid_input,
                "say which files are to be written: --op4, --op4-text, --dmig, --mtx, --npz");
  options.interrupted = stop_was_asked;
  const StopSignals signals;
  const ReducedMatrices r = reduced_matrices(model, what, options);
  if (r.status.code == StatusCode::cancelled) {
    print_note("espalier: stopped\n");
    return kInterrupted;
  }
  if (!r.status.ok()) throw Error(r.status);
  const std::string stem = out.empty() ? r.body : out;
  const std::vector<std::string> written = write_reduced_matrices(r, stem, files);
  if (quiet) return kSolved;
  print_result("'{}': {} unknowns of {} interfaces and {} modes\n", r.body, r.size, r.interfaces.size(),
               r.frequencies.size());
  for (const ReducedInterface& at : r.interfaces)
    print_result("  node {} at ({:g}): {}, {} components\n", at.node, fmt::join(at.position, ", "), at.name,
                 at.components);
  if (!r.frequencies.empty())
    print_result("  modes with the interfaces at rest: {:.6g} to {:.6g} Hz, scalars {} to {}\n", r.frequencies.front(),
                 r.frequencies.back(), r.first_scalar,
                 r.first_scalar + static_cast<std::int64_t>(r.frequencies.size()) - 1);
  for (const std::string& notice : r.notices) print_result("  notice: {}\n", notice);
  print_result("wrote {}\n", fmt::join(written, ", "));
  return kSolved;
}

}  // namespace

void add_reduce(CLI::App& app, Action& action) {
  auto command = std::make_shared<ReduceCommand>();
  CLI::App* sub = app.add_subcommand(
      "reduce", "A flexible body as reduced matrices for other programs (docs/use/reduced_bodies.md)");
  add_file(*sub, "model", command->model, "the model")->required();
  sub->add_option("body", command->what.body, "its flexible body; may be left out where there is one alone");
  sub->add_option("--at", command->what.interfaces,
                  "an interface: a marker, or a frame of a joint or force as hinge.b; may be repeated. Default: all "
                  "frames of joints and forces on the body")
      ->type_name("NAME");
  sub->add_option("--modes", command->what.modes,
                  "modes with the interfaces at rest; default: as the body's 'reduce', or 20")
      ->check(CLI::NonNegativeNumber);
  sub->add_option("--frequency", command->what.frequency, "only modes below this one, Hz")->check(CLI::PositiveNumber);
  sub->add_option("--first-node", command->what.first_node, "number of the first interface in the files; default 1")
      ->check(CLI::PositiveNumber);
  add_file(*sub, "--out", command->out, "beginning of the names of the files; default: the body's name", "STEM");
  sub->add_flag("--op4", command->files.op4, "STEM.op4: OUTPUT4, binary");
  sub->add_flag("--op4-text", command->files.op4_text, "STEM_text.op4: OUTPUT4, text");
  sub->add_flag("--dmig", command->files.dmig, "STEM.bdf: DMIG, GRID and SPOINT cards");
  sub->add_flag("--mtx", command->files.mtx, "STEM_k.mtx, STEM_m.mtx, STEM_c.mtx: Matrix Market");
  sub->add_flag("--npz", command->files.npz, "STEM.npz: for NumPy");
  sub->add_option("--set", command->options.set, "replace a value of the model: PATH=VALUE; may be repeated")
      ->type_name("PATH=VALUE");
  sub->add_flag("-q,--quiet", command->quiet, "print nothing but errors");
  sub->callback([command, &action] { action = [command] { return command->run(); }; });
}

}  // namespace espalier::cli
