/// \file
/// Figures for people, the same on the terminal, in Markdown and on the page. "-" for what is not finite.
#pragma once

#include <string>

namespace espalier::measure {

std::string seconds_text(double seconds);        ///< "1.23 ms"
std::string count_text(double count);            ///< "12,345"; from 1e10 on "1.23e+10"
std::string bytes_text(double bytes);            ///< "1.23 GB" (powers of 1000)
std::string rate_text(double flops_per_second);  ///< "1.23 GFLOP/s"
std::string percent_text(double fraction);       ///< "12.3 %"
std::string factor_text(double factor);          ///< "1.23"
std::string error_text(double error);            ///< "1.2e-16"

}  // namespace espalier::measure
