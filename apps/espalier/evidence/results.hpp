/// \file
/// Files of results (docs/guide/measure.md) as the report reads them.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace espalier::cli::evidence {

using Json = nlohmann::json;

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

/// row[phase].median, or NaN.
double median(const Json& row, const char* phase);
/// A number, or NaN where the key is absent or null.
double number(const Json& object, const char* key);
/// A number at a path of keys, or NaN.
double number(const Json& object, const std::vector<const char*>& path);
bool solved(const Json& row);
/// Text at a key; empty where it is absent.
std::string text(const Json& object, const char* key);

/// The title of an experiment and one sentence that says how to read it.
std::string title_of(const std::string& experiment);
std::string explanation_of(const std::string& experiment);
/// The title, and the file's own "subject" where it has one: what tells it from others of its experiment.
std::string heading_of(const Results& results);
/// By experiment, what matters most first; within one by the name of the file.
void sort_results(std::vector<Results>& all);
/// "Intel ..., 2 cores, NVIDIA H200".
std::string machine_of(const Results& results);

// Numbers for people; "-" for NaN.
std::string seconds_text(double seconds);
std::string count_text(double count);
std::string bytes_text(double bytes);
std::string rate_text(double flops_per_second);
std::string percent_text(double fraction);
std::string factor_text(double factor);

}  // namespace espalier::cli::evidence
