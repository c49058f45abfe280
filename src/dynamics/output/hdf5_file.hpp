/// \file
/// An HDF5 file that grows by commits, each of which is whole or has not happened, whenever the process dies.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "base/at.hpp"
#include "dynamics/output/hdf5_objects.hpp"

namespace espalier::dynamics::hdf5 {

/// Groups and arrays are declared first; then rows and chunks are appended, and commit() makes them part of the file.
///
/// Layout: superblock, two slots for all headers, and data, which only grow. Headers of a commit go to the slot that is
/// not in use; then one write of the superblock, of 48 bytes, says which slot counts. Data in use are never changed
/// (but for nodes of the index of chunks, where a child is written before it is counted), so a file is valid and has
/// all that was committed after kill -9 at any time; nothing marks it as open. HDF5's own library has no such order:
/// what its mode for readers beside a writer (SWMR) leaves behind plain readers refuse.
///
/// The file is written beside its name, as PATH.espalier.part, until publish().
class File {
 public:
  explicit File(const std::string& path);
  ~File();
  File(const File&) = delete;
  File& operator=(const File&) = delete;

  /// Groups on the way are made. @param path  "VTKHDF/Steps"
  void add_attribute(const std::string& path, Attribute attribute);
  /// Rows of numbers in one piece. @return its number for append()
  int add_series(const std::string& path, NumberType type);
  /// Chunks of rows. @param rows  that are appended together, in as many chunks of one size as they take; what they do
  /// not fill is 0 @param fixed  whether there are just these rows
  int add_chunked(const std::string& path, NumberType type, std::uint64_t columns, std::uint64_t rows, bool fixed);
  /// Another name of a series (a hard link).
  void add_name(const std::string& path, int series);
  void add_texts(const std::string& path, const std::vector<std::string>& texts);
  /// The end of declarations. @throws Error(invalid_input) when the file cannot be made
  void begin();

  void append(int series, double value);
  void append(int series, std::int64_t value);
  /// The rows of add_chunked(). @param bytes  of all of them
  void append_rows(int chunked, const std::string& bytes);
  /// A chunk as it is in another file.
  void append_packed(int chunked, const std::string& packed);
  [[nodiscard]] std::uint64_t chunks_per_append(int chunked) const { return chunked_[place(chunked)].pieces; }
  [[nodiscard]] std::uint64_t rows_per_append(int chunked) const;
  void set_attribute(const std::string& path, const std::string& name, std::int64_t value);
  /// @throws Error(invalid_input) when the disk is full or fails
  void commit();
  /// Gives the file its name, at which another one may have been.
  void publish();
  [[nodiscard]] bool published() const { return published_; }
  [[nodiscard]] const std::string& written() const { return written_; }  ///< the name that it has until then

 private:
  friend class Earlier;
  struct Series {
    ArrayExtents shape;
    std::uint64_t address = kNowhere, capacity = 0;
    std::string fixed;  // texts
  };
  struct TreeNode {
    std::uint64_t address = 0;
    int children = 0;
  };
  struct Chunked {
    ArrayExtents shape;
    std::uint64_t chunk_rows = 1, pieces = 1, chunks = 0;
    bool fixed = false;
    std::vector<TreeNode> last;  // the last node of each level, leaves first
  };
  struct Object {
    std::string name;
    enum class Kind { group, series, chunked, name } kind = Kind::group;
    std::size_t number = 0;  // of what it is; of a name the object
    std::vector<Attribute> attributes;
    std::vector<std::size_t> members;
    std::uint64_t offset = 0;  // of its header in a slot
  };

  static std::size_t place(int number) { return at(number); }
  Object& object(const std::string& path);
  [[nodiscard]] std::string header_of(const Object& o, std::uint64_t base) const;
  [[nodiscard]] std::string record() const;
  [[nodiscard]] std::string headers(std::uint64_t base) const;
  [[nodiscard]] std::size_t record_bytes() const { return 32 + 16 * (series_.size() + chunked_.size()); }
  [[noreturn]] void fail(const char* what) const;
  void write_at(std::uint64_t address, const std::string& bytes);
  void append_bytes(Series& series, const std::string& row);
  void grow(Series& series);
  void add_child(Chunked& c, std::size_t level, std::uint64_t child, std::uint64_t first_row, std::uint64_t packed);
  std::uint64_t new_node(Chunked& c, std::size_t level, std::uint64_t left);
  std::uint64_t take(std::uint64_t bytes);

  std::string path_, written_;  // the name, and that which it has now
  int descriptor_ = -1;
  bool published_ = false;
  std::vector<Object> objects_{1};  // the root first
  std::vector<Series> series_;
  std::vector<Chunked> chunked_;
  std::uint64_t slot_bytes_ = 0, end_ = 0, commits_ = 0;
  std::uint32_t fingerprint_ = 0;  // of what is declared
};

/// Whether there is a file of this kind under that name.
[[nodiscard]] bool is_own(const std::string& path);

/// A file that an earlier run has written, with the same declarations.
class Earlier {
 public:
  /// @param like  begun @throws Error(invalid_input) when the file is not of that kind
  Earlier(const std::string& path, const File& like);
  ~Earlier();
  Earlier(const Earlier&) = delete;
  Earlier& operator=(const Earlier&) = delete;

  [[nodiscard]] std::uint64_t rows(int series) const { return series_[File::place(series)].count; }
  [[nodiscard]] std::uint64_t bits(int series, std::uint64_t row) const;  ///< the 8 bytes of a number
  [[nodiscard]] std::string packed(int chunked, std::uint64_t chunk) const;

 private:
  struct Array {
    std::uint64_t address = 0, count = 0;
  };
  struct Chunk {
    std::uint64_t address = 0, bytes = 0;
  };
  [[nodiscard]] std::string read(std::uint64_t address, std::size_t bytes) const;
  /// @param above  the level of the node above
  void walk(const ArrayExtents& shape, std::uint64_t node, int above, std::vector<Chunk>& out) const;

  std::string path_;
  int descriptor_ = -1;
  std::vector<Array> series_;
  std::vector<std::vector<Chunk>> chunks_;
};

}  // namespace espalier::dynamics::hdf5
