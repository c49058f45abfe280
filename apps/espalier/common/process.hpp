/// \file
/// Other programs, started without a shell.
#pragma once

#include <string>
#include <vector>

namespace espalier::cli {

struct ProcessResult {
  int exit_code = -1;  ///< 127: the program was not found; 128 + n: ended by signal n
  std::string output;  ///< what it wrote to standard output
  std::string errors;  ///< last line that it wrote to standard error
};

/// Runs `words` (the program, found on PATH, and its arguments) and waits for its end.
/// @throws Error(invalid_input) when no process can be made
ProcessResult run_program(const std::vector<std::string>& words);

}  // namespace espalier::cli
