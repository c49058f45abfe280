/// \file
/// Files of results (docs/guide/measure.md) as the report reads them.
#pragma once

#include <string>
#include <vector>

#include "measure/document.hpp"

namespace espalier::measure {

/// One file of results.
struct Results {
  std::string file;  ///< its name without folder
  std::string id;    ///< for links: the name without ".json", lower case, only letters, digits and hyphens
  Json data;

  [[nodiscard]] std::string experiment() const { return data.at("experiment"); }
  [[nodiscard]] const Json& rows() const { return data.at("rows"); }
};

/// @throws Error(invalid_input) for a file that cannot be read, is no JSON, or does not follow the schema
Results read_results(const std::string& path);

/// Lower-case letters, digits and hyphens of a text, for links.
std::string slug(const std::string& text);

/// The title of an experiment and one sentence that says how to read it.
std::string title_of(const std::string& experiment);
std::string explanation_of(const std::string& experiment);
/// The title, and the file's own "subject" where it has one: what tells it from others of its experiment.
std::string heading_of(const Results& results);
/// By experiment, what matters most first; within one by the name of the file.
void sort_results(std::vector<Results>& all);
/// "Intel ..., 2 cores, NVIDIA H200".
std::string machine_of(const Results& results);

}  // namespace espalier::measure
