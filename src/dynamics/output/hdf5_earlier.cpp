// A file of an earlier run, to be gone on with.
#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>

#include "dynamics/output/hdf5_file.hpp"
#include "espalier/types.hpp"

namespace espalier::dynamics::hdf5 {

bool is_own(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  std::string head(kFirstSlot + 8, '\0');
  return in.read(head.data(), static_cast<std::streamsize>(head.size())) &&
         root_of(head.substr(0, kSuperblock)) != kNowhere && head.compare(kFirstSlot, 8, kRecord) == 0;
}

Earlier::Earlier(const std::string& path, const File& like) : path_(path) {
  descriptor_ = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  try {
    const std::uint64_t root = descriptor_ < 0 ? kNowhere : root_of(read(0, kSuperblock));
    const std::size_t size = like.record_bytes();
    const std::string record = root == kNowhere || root < size ? "" : read(root - size, size);
    const bool own = record.size() == size && record.compare(0, 8, kRecord) == 0 &&
                     number_at(record.data() + 8, 8) == like.fingerprint_ &&
                     number_at(record.data() + size - 8, 8) == crc(record.substr(0, size - 8));
    if (!own)
      throw Error(StatusCode::invalid_input,
                  fmt::format("{}: the file is damaged, or not of the same bodies and quantities; give another folder, "
                              "or move it away",
                              path));
    const char* at = record.data() + 24;
    for (std::size_t k = 0; k < like.series_.size(); ++k, at += 16)
      series_.push_back({number_at(at, 8), number_at(at + 8, 8)});
    for (const File::Chunked& c : like.chunked_) {
      chunks_.emplace_back();
      if (number_at(at, 8) != kNowhere) walk(c.shape, number_at(at, 8), kMostLevels, chunks_.back());
      chunks_.back().resize(std::min<std::uint64_t>(chunks_.back().size(), number_at(at + 8, 8)));
      at += 16;
    }
  } catch (...) {
    if (descriptor_ >= 0) ::close(descriptor_);
    throw;
  }
}

Earlier::~Earlier() { ::close(descriptor_); }

std::string Earlier::read(std::uint64_t address, std::size_t bytes) const {
  struct stat info {};
  const bool inside = ::fstat(descriptor_, &info) == 0 && address <= static_cast<std::uint64_t>(info.st_size) &&
                      bytes <= static_cast<std::uint64_t>(info.st_size) - address;
  std::string out(inside ? bytes : 0, '\0');
  if (!inside ||
      ::pread(descriptor_, out.data(), bytes, static_cast<::off_t>(address)) != static_cast<::ssize_t>(bytes))
    throw Error(StatusCode::invalid_input, fmt::format("{}: the file is damaged; move it away", path_));
  return out;
}

void Earlier::walk(const ArrayExtents& shape, std::uint64_t node, int above, std::vector<Chunk>& out) const {
  const std::string bytes = read(node, node_bytes(shape));
  const std::size_t key = key_bytes(shape);
  const auto children = static_cast<std::size_t>(number_at(bytes.data() + 6, 2));
  const int level = static_cast<unsigned char>(bytes[5]);
  if (level >= above || bytes.compare(0, 4, "TREE") != 0 || children > kChunkChildren)
    throw Error(StatusCode::invalid_input, fmt::format("{}: the file is damaged; move it away", path_));
  for (std::size_t k = 0; k < children; ++k) {
    const char* at = bytes.data() + 24 + k * (key + 8);
    const std::uint64_t child = number_at(at + key, 8);
    if (level == 0) {
      out.push_back({child, number_at(at, 4)});
    } else {
      walk(shape, child, level, out);
    }
  }
}

std::uint64_t Earlier::bits(int series, std::uint64_t row) const {
  return number_at(read(series_[File::place(series)].address + 8 * row, 8).data(), 8);
}

std::string Earlier::packed(int chunked, std::uint64_t chunk) const {
  const std::vector<Chunk>& all = chunks_[File::place(chunked)];
  if (chunk >= all.size())
    throw Error(StatusCode::invalid_input, fmt::format("{}: the file is damaged; move it away", path_));
  return read(all[chunk].address, all[chunk].bytes);
}

}  // namespace espalier::dynamics::hdf5
