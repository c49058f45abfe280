/// \file
/// The report as one HTML page and as Markdown.
#pragma once

#include <string>
#include <vector>

#include "measure/results.hpp"

namespace espalier::cli::evidence {

/// Plots of one file as figures with inline SVG; empty where it has nothing to draw.
std::string plots_of(const measure::Results& results);

/// One self-contained page: no scripts, fonts or images from elsewhere.
std::string html_page(const std::vector<measure::Results>& all);

/// The same numbers as Markdown tables; under each its machine, versions, command, date and commit.
std::string markdown(const std::vector<measure::Results>& all);

/// The frame of the page (page.html of this folder); {{TITLE}}, {{CONTENTS}} and {{BODY}} are replaced.
extern const char* const kPageFrame;

}  // namespace espalier::cli::evidence
