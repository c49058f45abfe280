/// \file
/// What the commands `modes` and `harmonic` have in common: options that are theirs to choose, and how they end.
#pragma once

#include <functional>
#include <nlohmann/json.hpp>
#include <string>

#include "common/solver_flags.hpp"
#include "espalier/types.hpp"
#include "matrix/entries.hpp"
#include "sheet/sheet.hpp"

namespace espalier::cli {

/// @param who  "modes choose", for the message
/// @throws Error(invalid_input) where --kind, --precision or --singular was given
void refuse_chosen_flags(const SolverFlags& flags, const std::string& who);

/// How K, M and C are read. @param silent  what is read otherwise than it stands in the file is not said on stderr
[[nodiscard]] matrix::ReadOptions reading(base::ThreadPool& pool, bool silent);

/// How results are shown.
struct PencilOutput {
  bool json = false, quiet = false;
  std::string report_file, page_file;  ///< empty: none
};

/// Writes report and files, prints the report or the text, then what has failed.
/// @param report  made for an exit code  @param files  writes what the command's options ask for
/// @param sheet  the page of a report
/// @param text  for people; empty: there is nothing to show
/// @return the exit code  @throws Error where a file cannot be written
int conclude(const PencilOutput& output, const Status& status,
             const std::function<nlohmann::ordered_json(int code)>& report, const std::function<void()>& files,
             const std::function<Sheet(const Sheet::Json& report)>& sheet, const std::string& text);

}  // namespace espalier::cli
