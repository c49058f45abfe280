/// \file
/// The document of results (docs/guide/measure.md): one schema, written by `espalier bench`, by the programs of the GPU
/// and by the benchmarks of the dynamics, read by `espalier report`.
#pragma once

#include <cstddef>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace espalier::measure {

using Json = nlohmann::json;

/// The name of the schema; another number when a reader of the old one would misread the new.
inline constexpr const char* kSchema = "espalier-bench/1";

/// All samples of one phase, seconds.
struct Samples {
  std::vector<double> seconds;
  [[nodiscard]] bool empty() const { return seconds.empty(); }
  [[nodiscard]] double median() const;  ///< of an even number: the mean of the middle two; NaN when empty
  [[nodiscard]] double least() const;   ///< NaN when empty
  /// Place of the sample nearest the median. @pre not empty
  [[nodiscard]] std::size_t middle() const;
};

/// {"median", "least", "seconds"}; null where there are none.
Json samples_record(const Samples& samples);

/// What a document begins with.
struct DocumentHead {
  std::string experiment;
  std::string command;             ///< as typed
  std::string version;             ///< of Espalier
  Json settings = Json::object();  ///< what the run was asked for
};

/// A document without rows: head, date, commit and machine.
Json new_document(DocumentHead head);

/// A row in which every key of the schema stands; null where nothing is known. Its outcome is "ok".
Json empty_row(const std::string& system, const std::string& rival, const std::string& version);

/// Writes the document, whole or not at all. A folder takes it as <experiment>.json.
/// @throws Error(invalid_input) when it cannot be written
void write_document(const Json& document, const std::string& path);

/// row[phase].median, or NaN.
double median(const Json& row, const char* phase);
/// A number, or NaN where the key is absent or null.
double number(const Json& object, const char* key);
/// A number at a path of keys, or NaN.
double number(const Json& object, const std::vector<const char*>& path);
bool solved(const Json& row);
/// Text at a key; empty where it is absent.
std::string text(const Json& object, const char* key);

}  // namespace espalier::measure
