/// \file
/// The few objects of the HDF5 file format that results need, as bytes: superblock (version 2), object headers (version
/// 2) of groups and datasets, nodes of the index of chunks (B-tree version 1). After the HDF5 File Format Specification
/// 3.0; chapter numbers stand beside the functions.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace espalier::dynamics::hdf5 {

enum class NumberType { float32, float64, int64, uint8 };

[[nodiscard]] int bytes_of(NumberType type);

inline constexpr std::uint64_t kNowhere = ~std::uint64_t{0};  ///< the undefined address
inline constexpr std::size_t kSuperblock = 48;                ///< bytes
// Constants of our own files: a record of 8 letters and more stands before the headers of a slot.
inline constexpr char kRecord[] = "ESPALIER";
inline constexpr std::uint64_t kFirstSlot = 64;
inline constexpr int kMostLevels = 8;  ///< of the index: 64^8 chunks
[[nodiscard]] std::uint32_t crc(const std::string& bytes);

/// Numbers of the file are little-endian.
class Bytes {
 public:
  void append(std::uint64_t value, int bytes);
  void append(const std::string& text) { text_ += text; }
  void pad(std::size_t to) { text_.resize(to, '\0'); }
  [[nodiscard]] std::size_t size() const { return text_.size(); }
  [[nodiscard]] const std::string& text() const { return text_; }

 private:
  std::string text_;
};

[[nodiscard]] std::uint64_t number_at(const char* from, int bytes);

/// Jenkins' lookup3, with which HDF5 protects its metadata.
[[nodiscard]] std::uint32_t checksum(const std::string& bytes);

/// II.A. @param end  of the file @param root  address of the header of the root group
[[nodiscard]] std::string superblock(std::uint64_t end, std::uint64_t root);
/// The address of the root group, or kNowhere where the bytes are no superblock of ours.
[[nodiscard]] std::uint64_t root_of(const std::string& superblock);

struct Attribute {
  std::string name;
  std::string text;                   ///< of an attribute that is one
  std::vector<std::int64_t> numbers;  ///< else; of one that is a single number it is no array
  bool single = false;
};

/// IV.A.1.b; links are those of a group in its header.
struct GroupMember {
  std::string name;
  std::uint64_t address = 0;
};
[[nodiscard]] std::string group_header(const std::vector<Attribute>& attributes, const std::vector<GroupMember>& links);

/// rows x columns numbers, or texts of one length.
struct ArrayExtents {
  NumberType type = NumberType::float64;
  std::uint64_t rows = 0, columns = 0;  ///< columns 0: an array of one dimension
  std::uint64_t text = 0;               ///< bytes of each text; 0: numbers
  [[nodiscard]] std::uint64_t row_bytes() const;
};
/// An array in one piece at an address.
[[nodiscard]] std::string contiguous_header(const ArrayExtents& shape, std::uint64_t address);
/// An array in chunks of some rows, shuffled and deflated. @param index  address of the root of their B-tree
[[nodiscard]] std::string chunked_header(const ArrayExtents& shape, std::uint64_t chunk_rows, std::uint64_t index);

/// A node of the index of chunks, III.A.1, with room for kChunkChildren of them; a child is appended to a node in the
/// file by three writes (entry(), its place, number of entries), after each of which the node is a valid one.
inline constexpr int kChunkChildren = 64;
[[nodiscard]] std::size_t key_bytes(const ArrayExtents& shape);
[[nodiscard]] std::size_t node_bytes(const ArrayExtents& shape);
/// @param first_row, packed  of the chunk that the key stands for; packed: its bytes
[[nodiscard]] std::string chunk_key(const ArrayExtents& shape, std::uint64_t first_row, std::uint64_t packed);
[[nodiscard]] std::string empty_node(const ArrayExtents& shape, int level, std::uint64_t left);

}  // namespace espalier::dynamics::hdf5
