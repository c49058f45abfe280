// NumPy's .npz: a zip archive (PKWARE's APPNOTE 6.3, stored members) of .npy files (NumPy's format 1.0).
#include <fmt/format.h>
#include <zlib.h>

#include "dynamics/substructure/write_matrices.hpp"

namespace espalier::dynamics {
namespace {

/// The lowest `bytes` bytes of a number, lowest first.
void append(std::string& out, std::uint64_t value, int bytes) {
  for (int k = 0; k < bytes; ++k) out += static_cast<char>((value >> (8 * k)) & 0xff);
}

std::string npy_header(const NamedArray& array) {
  std::string shape;
  for (const std::size_t n : array.shape) shape += fmt::format("{}, ", n);
  std::string text = fmt::format("{{'descr': '{}', 'fortran_order': {}, 'shape': ({}), }}", array.type,
                                 array.shape.size() > 1 ? "True" : "False", shape);
  constexpr std::size_t kBefore = 10, kMultiple = 64;  // the data begin at a multiple
  text.append(kMultiple - 1 - (kBefore + text.size()) % kMultiple, ' ');
  text += '\n';
  std::string out = "\x93NUMPY";
  out += '\x01';
  out += '\x00';
  append(out, text.size(), 2);
  return out + text;
}

}  // namespace

std::string npz_file(std::span<const NamedArray> arrays) {
  constexpr std::uint64_t kLocal = 0x04034b50, kCentral = 0x02014b50, kEnd = 0x06054b50;
  std::string out, directory;
  for (const NamedArray& array : arrays) {
    const std::string name = array.name + ".npy";
    std::string content = npy_header(array);
    content.append(static_cast<const char*>(array.values), array.bytes);
    constexpr std::size_t kMost = 0xffffffff;
    if (out.size() + content.size() + 1000 > kMost)
      throw Error(StatusCode::invalid_input, "a .npz file cannot be above 4 GB; take fewer modes or Matrix Market");
    const std::uint64_t crc = crc32_z(0, reinterpret_cast<const Bytef*>(content.data()), content.size());
    const auto common = [&](std::string& to) {  // version, flags, stored, 1980-01-01, sizes
      append(to, 20, 2);
      append(to, 0, 2);
      append(to, 0, 2);
      append(to, 0, 2);
      append(to, 0x21, 2);
      append(to, crc, 4);
      append(to, content.size(), 4);
      append(to, content.size(), 4);
      append(to, name.size(), 2);
      append(to, 0, 2);
    };
    append(directory, kCentral, 4);
    append(directory, 20, 2);
    common(directory);
    append(directory, 0, 2);
    append(directory, 0, 2);
    append(directory, 0, 2);
    append(directory, 0, 4);
    append(directory, out.size(), 4);
    directory += name;
    append(out, kLocal, 4);
    common(out);
    out += name + content;
  }
  const std::size_t at = out.size();
  out += directory;
  append(out, kEnd, 4);
  append(out, 0, 2);
  append(out, 0, 2);
  append(out, arrays.size(), 2);
  append(out, arrays.size(), 2);
  append(out, directory.size(), 4);
  append(out, at, 4);
  append(out, 0, 2);
  return out;
}

}  // namespace espalier::dynamics
