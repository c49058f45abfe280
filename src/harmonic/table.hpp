/// \file
/// A frequency response as a table, and its highest amplitudes.
#pragma once

#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "espalier/harmonic.hpp"

namespace espalier::harmonic {

/// From -180 to 180.
[[nodiscard]] double degrees(std::complex<double> x);

/// Where the response of an output to a load is largest.
struct Peak {
  Index load = 0, output = 0;  ///< from 0
  double frequency = 0, amplitude = 0, phase = 0;
};
/// The peaks of each load and output, but for those without any number.
[[nodiscard]] std::vector<Peak> highest(const HarmonicResult& r);

/// Lines of CSV, each with its end: frequency, solved (1) or interpolated (0), backward_error, error_estimate, then
/// amplitude_OUTPUT_LOAD and phase_OUTPUT_LOAD in degrees. Cells of what is not known are empty.
/// @param outputs, loads  their names  @param write  takes one line after another
void write_table(const HarmonicResult& r, const std::vector<std::string>& outputs,
                 const std::vector<std::string>& loads, const std::function<void(std::string_view)>& write);

}  // namespace espalier::harmonic
