/// \file
/// Matrices of the SuiteSparse collection (sparse.tamu.edu) that this project speaks of.
#pragma once

#include <cstdint>
#include <vector>

namespace espalier::cli {

struct CollectionMatrix {
  const char *name, *group;
  std::int64_t rows;      ///< what the collection's page says; checked against the file
  std::int64_t nonzeros;  ///< of the whole matrix, both triangles, as the page counts (explicit zeros left out)
  const char* kind;       ///< in a few words
};

/// In the order of the list that people see.
const std::vector<CollectionMatrix>& collection();

}  // namespace espalier::cli
