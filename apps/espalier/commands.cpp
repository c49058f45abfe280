#include "command.hpp"

namespace espalier::cli {

void add_commands(CLI::App& app, int argc, const char* const* argv, Action& action) {
  add_solve(app, action);
  add_analyze(app, action);
  add_modes(app, action);
  add_harmonic(app, action);
  add_condense(app, action);
  add_inverse(app, action);
  add_simulate(app, action);
  add_export_fmu(app, action);
  add_view(app, action);
  add_examples(app, action);
  add_mesh(app, action);
  add_reduce(app, action);
  add_robot(app, action);
  add_generate(app, action);
  add_bench(app, argc, argv, action);
  add_report(app, action);
  add_evidence(app, action);
  add_fetch_matrix(app, action);
  add_run(app, action);
  add_mpi_adapter(app, action);
  add_info(app, action);
}

}  // namespace espalier::cli
