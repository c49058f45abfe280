/// \file
/// The page of a run: one HTML file that needs nothing beside itself.
#pragma once

#include <array>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "dynamics/page/film.hpp"
#include "dynamics/page/rows.hpp"
#include "espalier/dynamics.hpp"

namespace espalier::dynamics::page {

/// What a page says of its run beside pictures and rows.
struct RunOfPage {
  const SimulationSummary& summary;
  Status status;            ///< so far
  bool running = false;     ///< the page is renewed, and loads itself again
  std::string model, text;  ///< name and text of the model file
  std::vector<std::string> set;
  double begin = 0, end = 0;
  std::array<double, 3> gravity{};
  std::vector<SimulationQuantity> quantities;  ///< with dimensions
  /// Amplitudes and phases over frequencies, one column after the other: names without the frequency.
  struct Response {
    std::vector<std::string> names;
    std::vector<double> frequencies, columns;
  } response;
};

/// @param write  called with pieces of the page
void write_page(const RunOfPage& run, const Rows& rows, Film& film, const std::function<void(std::string_view)>& write);

}  // namespace espalier::dynamics::page
