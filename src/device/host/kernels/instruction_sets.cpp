#include "device/host/kernels/instruction_sets.hpp"

#include <fmt/format.h>

#include <cstdint>
#include <cstdlib>
#include <string_view>

#include "espalier/types.hpp"
#include "hwy/highway.h"

namespace espalier::device::host {

namespace {

/// @return whether the variable was understood. Better targets of Highway have lower bits.
bool limit_instruction_sets() {
  const char* text = std::getenv("ESPALIER_INSTRUCTIONS");
  const std::string_view word = text == nullptr ? "" : text;
  if (word == "avx2") hwy::DisableTargets(std::int64_t{HWY_AVX2} - 1);
  if (word == "baseline") hwy::DisableTargets((std::int64_t{HWY_AVX2} << 1) - 1);
  return word.empty() || word == "avx512" || word == "avx2" || word == "baseline";
}

const bool understood = limit_instruction_sets();

}  // namespace

void check_instruction_sets() {
  if (!understood)
    throw Error(StatusCode::invalid_input,
                fmt::format("ESPALIER_INSTRUCTIONS: '{}' is not understood; give avx512, avx2 or baseline",
                            std::getenv("ESPALIER_INSTRUCTIONS")));
}

}  // namespace espalier::device::host
