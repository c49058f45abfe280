/// \file
/// The tables of a file of results, the same for the page and for Markdown.
#pragma once

#include <vector>

#include "measure/results.hpp"
#include "measure/table.hpp"

namespace espalier::cli::evidence {

using namespace measure;  // NOLINT(google-build-using-namespace): the report speaks in the words of the results

/// The tables of one file, the main one first.
std::vector<DataTable> tables_of(const Results& results);

/// Share of the machine's dense product that the refactorization reaches, and of its memory bandwidth that the solve
/// reaches (every entry of the factor is read twice). NaN where something is not known.
double share_of_product(const Results& results, const Json& row);
double share_of_bandwidth(const Results& results, const Json& row);

}  // namespace espalier::cli::evidence
