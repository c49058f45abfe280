// Where an output file goes. Truth: what stands in a private folder afterwards.
#include "base/output_file.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <set>
#include <thread>

namespace espalier::base {
namespace {

namespace fs = std::filesystem;

class OutputFileTest : public testing::Test {
 protected:
  void SetUp() override {
    std::string name = (fs::temp_directory_path() / "espalier-out-XXXXXX").string();
    folder_ = fs::canonical(mkdtemp(name.data()));
  }
  void TearDown() override { fs::remove_all(folder_); }
  [[nodiscard]] std::string at(const std::string& name) const { return (folder_ / name).string(); }
  static void write(const std::string& path, const std::string& text) {
    OutputFile file(path);
    file.write(text);
    file.commit();
  }
  static std::string get(const std::string& path) {
    std::ifstream in(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  [[nodiscard]] std::set<std::string> names() const {
    std::set<std::string> result;
    for (const auto& entry : fs::directory_iterator(folder_)) result.insert(entry.path().filename());
    return result;
  }
  fs::path folder_;
};

TEST_F(OutputFileTest, LinksAreFollowedAndStayLinks) {
  fs::create_directory(folder_ / "far");
  std::ofstream(at("far/there")) << "old";
  fs::create_symlink("far/there", folder_ / "link");
  fs::create_symlink("link", folder_ / "second");
  fs::create_symlink("far/new", folder_ / "dangling");
  write(at("second"), "one");
  write(at("dangling"), "two");
  EXPECT_EQ(get(at("far/there")), "one");
  EXPECT_EQ(get(at("far/new")), "two");
  for (const char* name : {"link", "second", "dangling"}) EXPECT_TRUE(fs::is_symlink(folder_ / name)) << name;
  EXPECT_EQ(names(), (std::set<std::string>{"far", "link", "second", "dangling"}));
}

TEST_F(OutputFileTest, LinksInACircleAndFoldersAreRefused) {
  fs::create_symlink("b", folder_ / "a");
  fs::create_symlink("a", folder_ / "b");
  fs::create_directory(folder_ / "folder");
  fs::create_symlink("folder", folder_ / "to_folder");
  for (const char* name : {"a", "folder", "to_folder", "folder/", "none/x", "."}) {
    EXPECT_THROW(OutputFile{at(name)}, Error) << name;
    EXPECT_THROW(check_writable(at(name)), Error) << name;
  }
  EXPECT_TRUE(fs::is_symlink(folder_ / "a"));
}

TEST_F(OutputFileTest, DescriptorsAreWrittenDirectlyWhereTheyStand) {
  const int descriptor = ::open(at("log").c_str(), O_RDWR | O_CREAT, 0600);
  ASSERT_EQ(::write(descriptor, "before ", 7), 7);
  const std::string number = std::to_string(descriptor);
  fs::create_symlink("/proc/self/fd/" + number, folder_ / "link");
  check_writable(at("link"));
  write("/dev/fd/" + number, "one ");
  write(at("link"), "two ");
  ASSERT_EQ(::write(descriptor, "after", 5), 5);
  ::close(descriptor);
  EXPECT_EQ(get(at("log")), "before one two after");
  EXPECT_TRUE(fs::is_symlink(folder_ / "link"));
  EXPECT_THROW(check_writable(at("link")), Error);  // closed now
  EXPECT_EQ(names(), (std::set<std::string>{"log", "link"}));
}

TEST_F(OutputFileTest, PipesAndDevicesAreWrittenDirectly) {
  ASSERT_EQ(::mkfifo(at("pipe").c_str(), 0600), 0);
  fs::create_symlink("pipe", folder_ / "link");
  std::string received;
  std::thread reader([&] { received = get(at("pipe")); });
  write(at("link"), "through the pipe");
  reader.join();
  EXPECT_EQ(received, "through the pipe");
  EXPECT_TRUE(fs::is_fifo(folder_ / "pipe"));
  constexpr unsigned kNullMajor = 1, kNullMinor = 3;
  if (::mknod(at("null").c_str(), S_IFCHR | 0600, makedev(kNullMajor, kNullMinor)) != 0)
    GTEST_SKIP() << "no permission to make a device";
  try {
    write(at("null"), "nothing");
  } catch (const Error&) {  // file systems mounted without devices
  }
  EXPECT_TRUE(fs::is_character_file(folder_ / "null"));
}

TEST_F(OutputFileTest, PermissionsStay) {
  std::ofstream(at("x")) << "old";
  ASSERT_EQ(::chmod(at("x").c_str(), 0640), 0);
  write(at("x"), "new");
  EXPECT_EQ(get(at("x")), "new");
  EXPECT_EQ(fs::status(at("x")).permissions(), fs::perms(0640));
  ASSERT_EQ(::chmod(at("x").c_str(), 0440), 0);
  if (::geteuid() == 0) GTEST_SKIP() << "root may write what is write-protected";
  EXPECT_THROW(write(at("x"), "newer"), Error);
  EXPECT_EQ(get(at("x")), "new");
}

TEST_F(OutputFileTest, WhatAKilledRunLeftIsRemovedAndWhatIsBeingWrittenStays) {
  const std::string part = at("x") + ".espalier.part";
  std::ofstream(part) << "half of it";
  write(at("x"), "whole");
  EXPECT_EQ(names(), std::set<std::string>{"x"});
  {
    OutputFile slow(at("x"));  // two at a time
    slow.write("slow");
    write(at("x"), "fast");
    EXPECT_EQ(get(at("x")), "fast");
    remove_abandoned(folder_.string());
    EXPECT_TRUE(fs::exists(part));
    slow.commit();
  }
  EXPECT_EQ(get(at("x")), "slow");
  std::ofstream(part) << "left again";
  std::ofstream(at("other.part")) << "somebody else's";
  remove_abandoned(folder_.string());
  EXPECT_EQ(names(), (std::set<std::string>{"x", "other.part"}));
}

TEST_F(OutputFileTest, LongNamesFit) {
  const std::string name(250, 'n');
  write(at(name), "here");
  EXPECT_EQ(get(at(name)), "here");
  EXPECT_EQ(names().size(), 1U);
}

TEST_F(OutputFileTest, OneFileUnderManyNames) {
  fs::create_directory(folder_ / "d");
  fs::create_symlink("d", folder_ / "e");
  fs::create_symlink("d/y", folder_ / "l");
  const fs::path before = fs::current_path();
  fs::current_path(folder_);
  EXPECT_TRUE(same_file("x", "./x"));
  EXPECT_TRUE(same_file("x", at("x")));
  EXPECT_TRUE(same_file("d/y", "e/y"));
  EXPECT_TRUE(same_file("d/../d/y", "l"));
  EXPECT_FALSE(same_file("d/y", "d/z"));
  EXPECT_FALSE(same_file("none/y", "none/y"));
  EXPECT_FALSE(same_file("/dev/null", "/dev/null"));
  fs::current_path(before);
}

}  // namespace
}  // namespace espalier::base
