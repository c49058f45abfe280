#include "dynamics/mesh/read/vtu_bytes.hpp"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <stdexcept>
#include <vector>

namespace espalier::dynamics {
namespace {

constexpr std::size_t kMostRatio = 1032;  // of zlib: no stream unpacks to more

int base64_value(char c) {
  if (c >= 'A' && c <= 'Z') return c - 'A';
  if (c >= 'a' && c <= 'z') return c - 'a' + 26;
  if (c >= '0' && c <= '9') return c - '0' + 52;
  return c == '+' ? 62 : c == '/' ? 63 : -1;
}

/// Decodes as far as is needed.
class Bytes {
 public:
  Bytes(std::string_view text, const VtuCoding& coding) : text_(text), coding_(coding) {}
  /// The first `size` bytes.
  std::string_view first(std::size_t size) {
    if (!coding_.base64) {
      if (size > text_.size()) too_short(size, text_.size());
      return text_.substr(0, size);
    }
    if (decoded_.size() < size) decoded_ = decode_base64(text_, size);
    if (decoded_.size() < size) too_short(size, decoded_.size());
    return std::string_view(decoded_).substr(0, size);
  }
  /// The k-th number of the header.
  std::uint64_t header(std::size_t k) {
    const std::size_t width = coding_.wide_header ? 8 : 4;
    const std::string_view bytes = first((k + 1) * width).substr(k * width);
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < width; ++i)
      value = value << 8U | static_cast<std::uint8_t>(bytes[coding_.big_endian ? i : width - 1 - i]);
    return value;
  }
  /// No array has more bytes, whatever the header says.
  [[nodiscard]] std::size_t at_most() const { return text_.size(); }

 private:
  [[noreturn]] static void too_short(std::size_t needed, std::size_t have) {
    throw std::runtime_error(fmt::format("the array is cut off: {} bytes are announced, {} are there", needed, have));
  }
  std::string_view text_;
  VtuCoding coding_;
  std::string decoded_;
};

void unpack(std::string_view from, std::string& to, std::size_t size) {
  const std::size_t begin = to.size();
  if (size > kMostRatio * (from.size() + 1))
    throw std::runtime_error("a block announces more bytes than it can unpack to");
  to.resize(begin + size);
  auto length = static_cast<uLongf>(size);
  const int result = uncompress(reinterpret_cast<Bytef*>(to.data() + begin), &length,
                                reinterpret_cast<const Bytef*>(from.data()), static_cast<uLong>(from.size()));
  if (result != Z_OK || length != size) throw std::runtime_error("a compressed block of the array is broken");
}

std::string unpacked(Bytes& bytes, const VtuCoding& coding) {
  const std::size_t width = coding.wide_header ? 8 : 4;
  const std::uint64_t blocks = bytes.header(0);
  if (blocks > bytes.at_most() / width) throw std::runtime_error(fmt::format("{} blocks are announced", blocks));
  if (blocks == 0) return {};
  const std::uint64_t size = bytes.header(1), rest = bytes.header(2);
  std::vector<std::size_t> lengths;
  std::size_t end = static_cast<std::size_t>(3 + blocks) * width;
  static_cast<void>(bytes.first(end));
  for (std::size_t k = 0; k < blocks; ++k) {
    const std::uint64_t length = bytes.header(3 + k);
    if (length > bytes.at_most()) throw std::runtime_error(fmt::format("a block of {} bytes is announced", length));
    lengths.push_back(static_cast<std::size_t>(length));
  }
  std::string out;
  std::size_t all = end;
  for (const std::size_t length : lengths) {
    all += length;
    if (all > bytes.at_most()) throw std::runtime_error("the blocks announced are more than the file holds");
  }
  const std::string_view packed = bytes.first(all);
  for (std::size_t k = 0; k < blocks; ++k) {
    const bool partial = k + 1 == blocks && rest != 0;
    unpack(packed.substr(end, lengths[k]), out, static_cast<std::size_t>(partial ? rest : size));
    end += lengths[k];
  }
  return out;
}

}  // namespace

std::string decode_base64(std::string_view text, std::size_t most) {
  std::string out;
  out.reserve(std::min(most, text.size() / 4 * 3 + 3) + 3);
  std::array<int, 4> digits{};
  std::size_t have = 0, padding = 0;
  for (const char c : text) {
    if (c == ' ' || c == '\n' || c == '\r' || c == '\t') continue;
    if (c == '=')
      ++padding;
    else if (base64_value(c) < 0)
      break;
    digits[have++] = c == '=' ? 0 : base64_value(c);
    if (have < 4) continue;
    const auto bits = static_cast<unsigned>(digits[0] << 18 | digits[1] << 12 | digits[2] << 6 | digits[3]);
    for (std::size_t k = 0; k + padding < 3; ++k) out += static_cast<char>(bits >> (16U - 8U * k) & 0xFFU);
    have = padding = 0;
    if (out.size() >= most) break;
  }
  return out;
}

std::string vtu_bytes(std::string_view text, const VtuCoding& coding) {
  if (coding.base64) text = text.substr(std::min(text.find_first_not_of(" \t\r\n"), text.size()));
  Bytes bytes(text, coding);
  if (coding.compressed) return unpacked(bytes, coding);
  const std::uint64_t size = bytes.header(0);
  const std::size_t width = coding.wide_header ? 8 : 4;
  if (size > bytes.at_most())
    throw std::runtime_error(
        fmt::format("the array is cut off: {} bytes are announced, {} are there", size, bytes.at_most()));
  return std::string(bytes.first(width + static_cast<std::size_t>(size)).substr(width));
}

}  // namespace espalier::dynamics
