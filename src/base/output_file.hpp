/// \file
/// Files that are written all or not at all.
#pragma once

#include <cstdio>
#include <filesystem>
#include <string>
#include <string_view>

#include "espalier/types.hpp"

namespace espalier::base {

/// A file being written. What goes to a regular file, or to a name that is not there yet, is written under a temporary
/// name beside it, "NAME.espalier.part"; commit() gives it its name, the destructor of an uncommitted one removes it.
/// Symbolic links are followed, so a link stays one. A pipe, a device or an open descriptor (/dev/stdout, /dev/fd/3,
/// also through a link) is written directly. A file that is replaced keeps its permissions.
///
/// The temporary file is locked (flock) as long as it is written. One that a killed run left behind is not locked: the
/// next run that writes the same file removes it. While another process writes the same file, the temporary name
/// gets the process number as well, and the last to finish wins.
///
/// A path that ends in ".gz" is compressed.
class OutputFile {
 public:
  enum class Durability {
    normal,        ///< survives the death of the process
    power_failure  ///< is on the medium before it gets its name (milliseconds more)
  };

  /// @throws Error(invalid_input) when the file cannot be made, a link leads in a circle, or the file that is there is
  /// write-protected
  explicit OutputFile(std::string path, Durability durability = Durability::normal);
  ~OutputFile();
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;
  /// @throws Error(invalid_input) when the medium is full or fails
  void write(std::string_view bytes);
  /// @throws Error(invalid_input) when the medium is full or fails; if only the renaming fails, the error says under
  /// which name the content is
  void commit();

 private:
  [[noreturn]] void fail(const char* what) const;
  /// After a failed write. zlib goes on with what it was given where it is closed: while those bytes are still there.
  [[noreturn]] void abandon_packed();
  void open();
  /// Opens temporary_ for a regular file `target`; the descriptor.
  int open_temporary(const std::filesystem::path& target);
  /// Makes temporary_, locked. @return -1 where another process writes it
  int make_locked();

  std::string path_;
  Durability durability_;
  std::string target_;     ///< where links lead; empty: written directly
  std::string temporary_;  ///< empty: written directly
  int lock_ = -1;          ///< a second descriptor of the temporary file, open until that has its name
  std::FILE* plain_ = nullptr;
  void* packed_ = nullptr;  // gzFile
};

/// A name with a zero byte in it would be cut there by the system, and another file be read or written.
/// @throws Error(invalid_input) that says where the zero byte stands
void check_path(std::string_view path);

/// The file that `path` means: absolute, all links followed (also one that leads to a file that is not there yet), no
/// "." or "..". @throws Error(invalid_input) as check_path(), or when its folder is not there or links lead in a circle
std::filesystem::path followed(const std::string& path);

/// Whether both names lead to one regular file, be it there or not. Pipes and devices may well be named twice.
bool same_file(const std::string& a, const std::string& b);

/// Tries whether `path` could be written, and leaves what is there as it is.
/// @throws Error(invalid_input) with the system's reason
void check_writable(const std::string& path);

/// Removes the temporary files of killed runs from a folder; those of runs that still write stay.
void remove_abandoned(const std::string& folder) noexcept;

}  // namespace espalier::base
