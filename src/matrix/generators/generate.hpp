/// \file
/// Scalable systems of mechanics with random numbering, named by a few words.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "base/thread_pool.hpp"
#include "espalier/matrix.hpp"

namespace espalier::matrix {

/// What is generated; defined in families.hpp.
enum class Family { elasticity, plate, shell, poisson, kkt, kkt_scaled, kkt_redundant, gyroscopic, elasticity_mass };

/// Order of the groups of unknowns in the matrix.
enum class Numbering {
  random,   ///< groups shuffled; the (three) unknowns of a group stay together
  natural,  ///< grid order: x slowest, z fastest; multipliers last
};

/// A system, given by its family and sizes.
struct GeneratorSpec {
  Family family = Family::elasticity;
  Index nx = 1, ny = 1, nz = 1;  ///< elements (Poisson: nodes) of the box, plate, shell, or of each body
  Index bodies = 1;              ///< KKT families: bodies in the chain
  Index redundant = 0;           ///< kkt_redundant: redundant constraint rows
  std::uint64_t seed = 1;        ///< of element factors, numbering, scaling and redundant rows
  Numbering numbering = Numbering::random;
};

/// The words that parse_generator() understands, one form a line, for a help text.
std::string generator_usage();

/// Reads words such as "elasticity 40 40 40", "elasticity 40" (a cube), "plate 200 200", "shell 100 60", "poisson 50",
/// "kkt 20 20 8 8" (bodies, then elements of each; 20 8 8 by default), "kkt-scaled 20", "kkt-redundant 3 20 20 8 8"
/// (redundant rows first), "gyroscopic 24" (also "gyro"), "elasticity-mass 40" (the mass matrix of "elasticity 40").
/// Sizes may be joined: "20x8x8". Seed and numbering keep their defaults.
/// @throws Error(invalid_input) that says what was expected
GeneratorSpec parse_generator(std::span<const std::string> words);

/// The words that give this system back: "kkt 20 20 8 8".
std::string describe(const GeneratorSpec& spec);

/// Number of unknowns by the formula of the family; may exceed what generate() accepts.
std::int64_t unknowns(const GeneratorSpec& spec);

/// Makes the matrix: symmetric_lower (gyroscopic: general), rows rising within each column, no duplicates. The same
/// spec gives the same bits on every machine with any number of threads. Memory: the matrix, plus twice that for
/// kkt_redundant.
/// @throws Error(invalid_input) when a size is below 1 or the system has 2^31 or more unknowns
/// @throws Error(out_of_memory) when the matrix would not fit into this machine's memory
SparseMatrix generate(const GeneratorSpec& spec, base::ThreadPool* pool = nullptr);

}  // namespace espalier::matrix
