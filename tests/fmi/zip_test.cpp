#include "fmi/zip.hpp"

#include <gtest/gtest.h>
#include <zlib.h>

#include "espalier/types.hpp"

namespace espalier::fmi {
namespace {

std::string zip_message(const std::string& bytes, std::uint64_t most = ZipArchive::kMost) {
  try {
    const ZipArchive archive("a.fmu", bytes, most);
    for (const std::string& name : archive.names()) (void)archive.read(name);
  } catch (const Error& error) {
    return error.what();
  }
  return "read";
}

/// Bytes that do not compress.
std::string noise(std::size_t size) {
  std::string out(size, '\0');
  std::uint64_t x = 88172645463325252U;
  for (char& c : out) {
    x ^= x << 13, x ^= x >> 7, x ^= x << 17;
    c = static_cast<char>(x >> 32);
  }
  return out;
}

TEST(Zip, GivesBackWhatWasPacked) {
  for (const std::size_t size : {std::size_t{0}, std::size_t{1}, std::size_t{1000}, std::size_t{300000}}) {
    const std::vector<ZipMember> members = {
        {"a.txt", std::string(size, 'x')}, {"deep/er/noise.bin", noise(size)}, {"empty", ""}};
    const ZipArchive archive("a.fmu", make_zip(members));
    ASSERT_EQ(archive.names().size(), 3U);
    for (const ZipMember& m : members) EXPECT_EQ(archive.read(m.name), m.bytes) << m.name << " " << size;
    EXPECT_FALSE(archive.has("a"));
  }
  EXPECT_TRUE(ZipArchive("none", make_zip({})).names().empty());
  EXPECT_EQ(make_zip({{"a", "b"}}), make_zip({{"a", "b"}}));
}

TEST(Zip, RefusesNamesThatLeaveTheFolder) {
  for (const char* name : {"../x", "a/../../x", "/etc/x", "a/..", "..", "a\\..\\x", "C:x", "./x", ""})
    EXPECT_NE(zip_message(make_zip({{name, "content"}})), "read") << name;
  for (const char* name : {"..x", "a/.x", "a..b/c", "binaries/linux64/x.so"})
    EXPECT_EQ(zip_message(make_zip({{name, "content"}})), "read") << name;
}

TEST(Zip, RefusesArchivesThatFillMemory) {
  const std::string bomb = make_zip({{"zeros", std::string(5000000, '\0')}});
  EXPECT_LT(bomb.size(), 60000U);
  EXPECT_NE(zip_message(bomb, 1000000).find("would unpack to 5 MB"), std::string::npos);
  EXPECT_EQ(zip_message(bomb), "read");
  std::string lies = bomb;  // a size that no deflated bytes have: refused before there is memory for it
  const std::size_t directory = lies.rfind("PK\1\2");
  for (const std::size_t at : {directory + 24, std::size_t{22}}) lies.replace(at, 4, "\xff\xff\xff\x7f");
  EXPECT_NE(zip_message(lies, std::uint64_t{1} << 40).find("damaged"), std::string::npos);
}

TEST(Zip, RefusesWhatIsThereTwiceOrUnknown) {
  EXPECT_NE(zip_message(make_zip({{"a", "1"}, {"a", "2"}})).find("there twice"), std::string::npos);
  EXPECT_NE(zip_message("PK").find("no ZIP archive"), std::string::npos);
  EXPECT_NE(zip_message("").find("no ZIP archive"), std::string::npos);
  EXPECT_NE(zip_message(std::string(100, 'x')).find("no ZIP archive"), std::string::npos);
  EXPECT_THROW((void)ZipArchive("a", make_zip({{"a", "1"}})).read("b"), Error);
}

TEST(Zip, NeverReadsBeyondDamagedBytes) {
  const std::string whole = make_zip({{"a", std::string(50, 'y')}, {"b/c", noise(40)}});
  for (std::size_t cut = 0; cut < whole.size(); ++cut)
    EXPECT_NE(zip_message(whole.substr(0, cut)), "read") << "cut at " << cut;
  int noticed = 0;
  for (std::size_t at = 0; at < whole.size(); ++at)
    for (const int flip : {1, 0x80, 0xff}) {
      std::string damaged = whole;
      damaged[at] = static_cast<char>(damaged[at] ^ flip);
      noticed += zip_message(damaged) == "read" ? 0 : 1;
    }
  EXPECT_GT(noticed, static_cast<int>(whole.size()));  // attributes and times may be anything
}

}  // namespace
}  // namespace espalier::fmi
