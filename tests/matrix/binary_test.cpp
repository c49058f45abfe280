#include "matrix/binary.hpp"

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "matrix/helpers.hpp"
#include "matrix/read.hpp"
#include "matrix/triplets.hpp"

namespace espalier::matrix {
namespace binary_test {

std::string bytes_of(const SparseMatrix& a) {
  write_binary(temporary("binary.esp"), a);
  std::stringstream bytes;
  bytes << std::ifstream(temporary("binary.esp"), std::ios::binary).rdbuf();
  std::filesystem::remove(temporary("binary.esp"));
  return bytes.str();
}

SparseMatrix sample(Storage storage) {
  auto a = random_matrix(7, 7, 3, storage, 5);
  sum_duplicates_sorted(a);
  return a;
}

// Truth: the matrix written, bit for bit.
TEST(Binary, EveryStorageComesBack) {
  for (const auto storage :
       {Storage::general, Storage::symmetric_lower, Storage::symmetric_upper, Storage::symmetric_both})
    for (const bool values : {true, false}) {
      SparseMatrix a = sample(storage == Storage::symmetric_both ? Storage::general : storage);
      a.storage = storage;
      if (!values) a.values.clear();
      write_binary(temporary("binary.esp"), a);
      const auto b = read_matrix(temporary("binary.esp"));
      EXPECT_EQ(b.rows, a.rows);
      EXPECT_EQ(b.col_ptr, a.col_ptr);
      EXPECT_EQ(b.row_ind, a.row_ind);
      EXPECT_EQ(b.values, a.values);
      EXPECT_EQ(b.storage, a.storage);
    }
  std::filesystem::remove(temporary("binary.esp"));
  const SparseMatrix empty{0, 0, {0}, {}, {}, Storage::general};
  EXPECT_EQ(parse_binary(bytes_of(empty), "e").nonzeros(), 0);
}

// Truth: the layout documented in the header.
TEST(Binary, Layout) {
  const std::string bytes = bytes_of(SparseMatrix{2, 1, {0, 2}, {0, 1}, {1.5, 2.5}, Storage::general});
  ASSERT_EQ(bytes.size(), 56u + 2 * 8 + 2 * 8 + 2 * 4);
  EXPECT_EQ(bytes.substr(0, 8), "ESPALMTX");
  std::int32_t rows = 0;
  std::int64_t entries = 0;
  double second = 0;
  std::memcpy(&rows, bytes.data() + 16, 4);
  std::memcpy(&entries, bytes.data() + 24, 8);
  std::memcpy(&second, bytes.data() + 56 + 16 + 8, 8);
  EXPECT_EQ(rows, 2);
  EXPECT_EQ(entries, 2);
  EXPECT_EQ(second, 2.5);
}

// Truth: every single flipped bit and every truncation is noticed.
TEST(Binary, DamageIsNoticed) {
  const std::string good = bytes_of(sample(Storage::symmetric_lower));
  for (std::size_t i = 8; i < good.size(); ++i) {  // without the magic it is no file of this format
    std::string bad = good;
    bad[i] = static_cast<char>(bad[i] ^ (1 << i % 8));
    EXPECT_THROW((void)parse_binary(bad, "b"), Error) << "byte " << i;
  }
  for (std::size_t size = 0; size < good.size(); ++size)
    EXPECT_THROW((void)parse_binary(std::string_view(good).substr(0, size), "b"), Error) << size << " bytes";
  EXPECT_THROW((void)parse_binary(good + "x", "b"), Error);
}

TEST(Binary, MessagesSayWhatToDo) {
  std::string bytes = bytes_of(sample(Storage::general));
  std::string other = bytes;
  std::reverse(other.begin() + 12, other.begin() + 16);
  expect_error([&] { (void)parse_binary(other, "b.esp"); }, {"b.esp", "byte order"});
  other = bytes;
  other[8] = 9;
  expect_error([&] { (void)parse_binary(other, "b.esp"); }, {"b.esp", "version 9"});
  expect_error([&] { (void)parse_binary(bytes.substr(0, 100), "b.esp"); }, {"b.esp", "truncated"});
}

}  // namespace binary_test
}  // namespace espalier::matrix
