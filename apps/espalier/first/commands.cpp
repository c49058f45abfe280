// The binary with which ./run shows its first result: `solve` needs half of what the others need to be compiled.
#include "command.hpp"

namespace espalier::cli {

void add_commands(CLI::App& app, int /*argc*/, const char* const* /*argv*/, Action& action) { add_solve(app, action); }

}  // namespace espalier::cli
