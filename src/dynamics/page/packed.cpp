#include "dynamics/page/packed.hpp"

#include <zlib.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <new>

namespace espalier::dynamics::page {

void Quantized::add(std::span<const double> values, std::size_t first, std::size_t stride) {
  constexpr double kSteps = 65534;
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (std::size_t k = first; k < values.size(); k += stride)
    if (std::isfinite(values[k])) low = std::min(low, values[k]), high = std::max(high, values[k]);
  if (!(low <= high)) low = high = 0;
  const double scale = high > low && std::isfinite(high - low) ? kSteps / (high - low) : 0;
  for (std::size_t k = first; k < values.size(); k += stride)
    steps.push_back(std::isfinite(values[k]) ? static_cast<std::uint16_t>(std::lround((values[k] - low) * scale))
                                             : std::uint16_t{65535});
  ranges.push_back(low);
  ranges.push_back(high);
}

std::string split_bytes(std::span<const std::uint16_t> numbers) {
  std::string out(2 * numbers.size(), '\0');
  for (std::size_t k = 0; k < numbers.size(); ++k) {
    out[k] = static_cast<char>(numbers[k] & 0xFFU);
    out[numbers.size() + k] = static_cast<char>(numbers[k] >> 8U);
  }
  return out;
}

std::string compressed(std::string_view bytes, int level) {
  z_stream stream{};
  constexpr int kGzip = 15 + 16;
  if (deflateInit2(&stream, level, Z_DEFLATED, kGzip, 8, Z_DEFAULT_STRATEGY) != Z_OK) throw std::bad_alloc();
  std::string out(deflateBound(&stream, bytes.size()), '\0');
  std::string_view left = bytes;
  std::size_t made = 0;
  int state = Z_OK;
  while (state == Z_OK) {  // zlib counts in 32 bits
    const std::size_t piece = std::min<std::size_t>(left.size(), 1U << 30U);
    const std::size_t room = std::min<std::size_t>(out.size() - made, 1U << 30U);
    stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(left.data()));
    stream.avail_in = static_cast<uInt>(piece);
    stream.next_out = reinterpret_cast<Bytef*>(out.data() + made);
    stream.avail_out = static_cast<uInt>(room);
    state = deflate(&stream, piece == left.size() ? Z_FINISH : Z_NO_FLUSH);
    left.remove_prefix(piece - stream.avail_in);
    made += room - stream.avail_out;
  }
  deflateEnd(&stream);
  out.resize(made);
  return out;
}

std::string base64(std::string_view bytes) {
  constexpr std::string_view kLetters = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out((bytes.size() + 2) / 3 * 4, '=');
  const auto byte = [&](std::size_t k) { return k < bytes.size() ? static_cast<unsigned char>(bytes[k]) : 0U; };
  std::size_t to = 0;
  for (std::size_t k = 0; k < bytes.size(); k += 3, to += 4) {
    const std::uint32_t word = (byte(k) << 16U) | (byte(k + 1) << 8U) | byte(k + 2);
    out[to] = kLetters[word >> 18U];
    out[to + 1] = kLetters[(word >> 12U) & 63U];
    if (k + 1 < bytes.size()) out[to + 2] = kLetters[(word >> 6U) & 63U];
    if (k + 2 < bytes.size()) out[to + 3] = kLetters[word & 63U];
  }
  return out;
}

}  // namespace espalier::dynamics::page
