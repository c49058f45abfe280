/// \file
/// What mutated sources ask (scripts/mutate.py): whether this process runs mutant `number`.
#pragma once

namespace espalier_mutants {

extern int chosen;              ///< the mutant of this process, 0: none
extern unsigned char* reached;  ///< per mutant, whether a test came past it; null where nobody asks

inline bool on(int number) {
  if (reached) reached[number] = 1;
  return chosen == number;
}

inline double sign(int number) { return on(number) ? -1 : 1; }

}  // namespace espalier_mutants
