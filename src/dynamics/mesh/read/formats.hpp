/// \file
/// The kinds of mesh files: what is read of each. The readers are found by this table, and the page "Your files" of the
/// guide shows it.
#pragma once

#include <span>
#include <string>

#include "dynamics/mesh/deck/deck.hpp"
#include "dynamics/mesh/mesh.hpp"

namespace espalier::dynamics {

struct MeshFormat {
  const char* endings;  ///< ".bdf .nas .dat": small letters, separated by blanks
  const char* program;  ///< whose files they are
  Mesh (*read)(const std::string& path);
  const char* elements;     ///< kinds that are read
  const char* sets;         ///< what becomes sets, and their names
  const char* more;         ///< materials, coordinates, files of files
  const char* passed_over;  ///< with a notice, or refused
  Deck (*deck)(std::string content, const std::string& name, int step) = nullptr;  ///< null: they are meshes alone
};

/// All that read_mesh() reads.
[[nodiscard]] std::span<const MeshFormat> mesh_formats();

/// The row of a file by the ending of its name, in small or capital letters, which .gz may follow; null: none.
[[nodiscard]] const MeshFormat* mesh_format_of(const std::string& path);

/// Whether a file of this name is a deck that can be run by itself: Abaqus, CalculiX, Nastran.
[[nodiscard]] bool is_deck(const std::string& path);

/// The table in Markdown.
[[nodiscard]] std::string mesh_formats_table();

/// What to do with a mesh file that was given where a model is needed; empty for other files.
[[nodiscard]] std::string mesh_is_no_model(const std::string& path);

}  // namespace espalier::dynamics
