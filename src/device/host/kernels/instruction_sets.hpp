/// \file
/// Which instruction sets the kernels may use.
#pragma once

namespace espalier::device::host {

/// ESPALIER_INSTRUCTIONS names the best instruction set that kernels of this process may use: avx512, avx2 or
/// baseline (without both). It is read when the program (or the library) is loaded, before any kernel is chosen;
/// without it the machine's best is taken. This is for tests and measurements: results of one set are what a machine
/// without the better ones computes.
/// @throws Error (invalid_input) where the variable holds another word
void check_instruction_sets();

}  // namespace espalier::device::host
