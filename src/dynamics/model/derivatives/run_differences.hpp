/// \file
/// Derivatives beside differences of whole runs. Those of the steps of one run hold the steps fixed, so they do not
/// know that a switch (contact, limits, corners, jumps) comes at another time where a parameter is another.
#pragma once

#include <functional>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace espalier::dynamics::model {

/// Parameters by their place in the list, with the values that they get.
using MovedParameters = std::vector<std::pair<std::size_t, double>>;
/// Numbers at the end of a run of the model in which some parameters are moved; of the model itself where none is.
using EndOfRun = std::function<std::vector<double>(const MovedParameters&)>;

struct DerivativesToCheck {
  std::vector<std::string> numbers, parameters;  ///< names
  std::vector<double> values;                    ///< of the parameters
  std::vector<double> ways;                      ///< by which they are moved, > 0
  /// The noise of a number: by how much two runs may differ that should be alike.
  std::function<double(double number)> noise;
  bool replace = true;  ///< derivatives that are wrong, by those of differences
};

/// Compares derivatives (rows of numbers, columns of parameters) with runs in which each parameter is moved; of more
/// than 16 parameters with a run in which all are, first. Where they contradict each other, differences with two ways
/// tell what is right, if they agree.
/// @return what was wrong, for people; empty: nothing
std::string check_by_runs(const DerivativesToCheck& what, const EndOfRun& run, std::span<double> derivatives);

}  // namespace espalier::dynamics::model
