/// \file
/// The binary arrays of VTK's XML files: raw or base64, plain or in blocks that zlib has compressed.
#pragma once

#include <string>
#include <string_view>

namespace espalier::dynamics {

/// How a file stores its arrays (attributes of VTKFile and AppendedData).
struct VtuCoding {
  bool base64 = true, compressed = false, wide_header = false;  ///< header_type UInt64 instead of UInt32
  bool big_endian = false;
};

/// `text` up to the first character that is none of base64's, decoded; padding may stand in its middle.
/// @param most  bytes to decode at most
std::string decode_base64(std::string_view text, std::size_t most);

/// The bytes of the array that starts `text`. @throws std::runtime_error saying what is wrong: more is announced than
/// the text holds, or what is compressed is broken
std::string vtu_bytes(std::string_view text, const VtuCoding& coding);

}  // namespace espalier::dynamics
