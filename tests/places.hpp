/// \file
/// Where the tests find what lies beside them, in whatever folder they run. One source knows the paths, so that the
/// others compile the same in every checkout.
#pragma once

#include <filesystem>

namespace espalier::test {

/// The root of the checkout: models/, examples/, docs/, bench/results/.
std::filesystem::path source_folder();

/// Matrices, meshes and reference cases beside the checkout; may be absent. Tests that need them are skipped then.
std::filesystem::path shared_data();

}  // namespace espalier::test
