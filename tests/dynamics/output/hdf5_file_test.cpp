// The file that results go to, against itself read back, known checksums, and copies of it as a killed run leaves them.
// That other programs read it is tested with VTK's reader: python/tests/models/test_vtkhdf.py.
#include "dynamics/output/hdf5_file.hpp"

#include <gtest/gtest.h>

#include <bit>
#include <filesystem>
#include <fstream>

#include "dynamics/model/model_common.hpp"
#include "dynamics/output/vtkhdf.hpp"
#include "espalier/types.hpp"

namespace espalier::dynamics {
namespace hdf5_file_test {

using hdf5::Earlier;
using hdf5::File;
using hdf5::NumberType;

// Examples of Jenkins' lookup3.c, whose hashlittle() HDF5 takes with an initial value of 0.
TEST(Hdf5Objects, ChecksumsAreThoseOfLookup3) {
  EXPECT_EQ(hdf5::checksum(""), 0xDEADBEEFU);
  EXPECT_EQ(hdf5::checksum("Four score and seven years ago"), 0x17770551U);
}

struct Arrays {
  int series, chunked;
};
Arrays declare(File& file) {
  file.add_attribute("top/steps", {"N", "", {0}, true});
  const Arrays a{file.add_series("top/steps/t", NumberType::float64),
                 file.add_chunked("top/values", NumberType::float64, 3, 5, false)};
  file.add_texts("names", {"one", "three"});
  file.begin();
  return a;
}

std::string rows_of(double first) {
  std::vector<double> values(15);
  for (std::size_t k = 0; k < values.size(); ++k) values[k] = first + static_cast<double>(k);
  return {reinterpret_cast<const char*>(values.data()), 8 * values.size()};
}

// Two and three levels of the index.
TEST(Hdf5File, ManyChunksAreFoundAgain) {
  const ScratchFolder folder;
  const std::string path = folder.path() + "/a.h5";
  constexpr std::uint64_t kCount = 64 * 64 + 130;
  File file(path);
  const Arrays a = declare(file);
  for (std::uint64_t k = 0; k < kCount; ++k) {
    file.append(a.series, 0.5 * static_cast<double>(k));
    file.append_packed(a.chunked, std::string(1 + k % 7, static_cast<char>('a' + k % 26)));
    if (k % 100 == 0 || k + 1 == kCount) file.commit();
  }
  file.publish();
  const Earlier back(path, file);
  ASSERT_EQ(back.rows(a.series), kCount);
  for (std::uint64_t k = 0; k < kCount; k += k < 140 ? 1 : 61) {
    EXPECT_EQ(std::bit_cast<double>(back.bits(a.series, k)), 0.5 * static_cast<double>(k));
    EXPECT_EQ(back.packed(a.chunked, k), std::string(1 + k % 7, static_cast<char>('a' + k % 26)));
  }
  EXPECT_THROW(static_cast<void>(back.packed(a.chunked, kCount)), Error);
}

// Without a commit nothing has happened; what was half written behind it does no harm.
TEST(Hdf5File, OnlyCommitsCount) {
  const ScratchFolder folder;
  const std::string path = folder.path() + "/a.h5";
  File file(path);
  const Arrays a = declare(file);
  file.append(a.series, 1.0);
  file.append_rows(a.chunked, rows_of(0));
  file.commit();
  file.publish();
  for (int k = 0; k < 70; ++k) {
    file.append(a.series, 2.0);
    file.append_rows(a.chunked, rows_of(7));
    const Earlier back(path, file);
    EXPECT_EQ(back.rows(a.series), 1U);
    EXPECT_EQ(std::bit_cast<double>(back.bits(a.series, 0)), 1.0);
    EXPECT_THROW(static_cast<void>(back.packed(a.chunked, 1)), Error);
  }
  file.commit();
  EXPECT_EQ(Earlier(path, file).rows(a.series), 71U);
}

TEST(Hdf5File, OthersAndDamagedOnesAreRefused) {
  const ScratchFolder folder;
  const std::string path = folder.path() + "/a.h5";
  File file(path);
  const Arrays a = declare(file);
  file.append(a.series, 1.0);
  file.commit();
  file.publish();
  EXPECT_TRUE(hdf5::is_own(path));
  File other(folder.path() + "/b.h5");
  other.add_series("top/t", NumberType::float64);
  other.begin();
  EXPECT_THROW(Earlier(path, other), Error);
  EXPECT_THROW(Earlier(folder.path() + "/none.h5", file), Error);
  for (const int at : {0, 30, 50, 70, 90}) {
    std::fstream io(path, std::ios::in | std::ios::out | std::ios::binary);
    io.seekg(at);
    const char old = static_cast<char>(io.get());
    io.seekp(at);
    io.put(static_cast<char>(old ^ 1));
    io.close();
    if (at != 50) {  // between superblock and headers stands nothing
      EXPECT_THROW(Earlier(path, file), Error) << at;
    }
    std::fstream again(path, std::ios::in | std::ios::out | std::ios::binary);
    again.seekp(at);
    again.write(&old, 1);
  }
  EXPECT_NO_THROW(Earlier(path, file));
  std::filesystem::resize_file(path, 100);
  EXPECT_THROW(Earlier(path, file), Error);
  EXPECT_THROW(File(folder.path() + "/no/such/a.h5"), Error);
}

// A body of one cell, frames at whole numbers.
class Frames {
 public:
  Frames() {
    const Index corners[] = {0, 1, 2, 3};
    cells_.add(ElementType::tet4, corners);
  }
  [[nodiscard]] VtkHdfLayout layout() const {
    return {&cells_, 4, body_, {"a"}, {{"displacement", 3}}, {{"von_mises", 1}}, {"q/1", "q_1"}};
  }
  static void write(VtkHdf& file, double t) {
    const std::vector<double> points(12, t), stress = {10 * t}, values = {-t, t};
    file.write({t, points, {points}, {stress}, values});
  }

 private:
  VtuCells cells_;
  std::vector<Index> body_ = {0};
};

std::string content(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

TEST(VtkHdfFile, GoesOnAndKeepsItsHistoryUntilItIsOvertaken) {
  const ScratchFolder folder;
  const std::string path = folder.path() + "/r.vtkhdf";
  const Frames frames;
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  {
    VtkHdf first(path, frames.layout(), kNone);
    EXPECT_FALSE(std::filesystem::exists(path));
    for (int t = 0; t < 4; ++t) Frames::write(first, t);
    first.finish();
  }
  const std::string whole = content(path);
  {
    VtkHdf second(path, frames.layout(), 1.0);
    EXPECT_EQ(second.kept(), 1.0);
    Frames::write(second, 2);
    EXPECT_EQ(content(path), whole);  // until 3 is there
    second.catch_up();
    const std::string copy = folder.path() + "/copy.vtkhdf";  // of what a run would find that restarts then
    std::filesystem::copy(path, copy);
    VtkHdf third(copy, frames.layout(), 9.0);
    EXPECT_EQ(third.kept(), 3.0);
    Frames::write(second, 3);
    EXPECT_EQ(content(path), whole);
    Frames::write(second, 4);
    second.finish();
  }
  EXPECT_GT(content(path).size(), 0U);
  EXPECT_EQ(VtkHdf(path, frames.layout(), 9.0).kept(), 4.0);
  {
    VtkHdf shorter(path, frames.layout(), 1.0);  // the run ends before
    Frames::write(shorter, 1.5);
    shorter.finish();
  }
  EXPECT_EQ(VtkHdf(path, frames.layout(), 9.0).kept(), 1.5);
  EXPECT_EQ(VtkHdf(folder.path() + "/none.vtkhdf", frames.layout(), 1.0).kept(), std::nullopt);
}

}  // namespace hdf5_file_test
}  // namespace espalier::dynamics
