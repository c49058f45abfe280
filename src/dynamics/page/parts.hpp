/// \file
/// The parts of the page that are the same for all runs. Their source is made at build (embed/) from browser/ and from
/// the libraries that are installed.
#pragma once

#include <span>
#include <string_view>

namespace espalier::dynamics::page {

[[nodiscard]] std::span<const std::string_view> page_head();  ///< up to the data
/// Scripts of three.js and dygraphs, as base64 of gzip; nothing where they were not installed.
[[nodiscard]] std::span<const std::string_view> page_libraries();
[[nodiscard]] std::span<const std::string_view> page_tail();  ///< what stands behind the data

}  // namespace espalier::dynamics::page
