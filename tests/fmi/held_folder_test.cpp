// Folders that FMUs are unpacked into: gone with their process, also when it is killed, and never taken from a living
// one.
#include "fmi/held_folder.hpp"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstdlib>

#include "espalier/types.hpp"
#include "fmi/foreign.hpp"
#include "fmus.hpp"

namespace espalier::fmi {
namespace {

/// TMPDIR is a folder of the test's own.
class HeldFolders : public ::testing::Test {
 protected:
  HeldFolders() {
    if (const char* known = std::getenv("TMPDIR")) before_ = known;
    ::setenv("TMPDIR", (home_ / "").c_str(), 1);
  }
  ~HeldFolders() override { before_.empty() ? ::unsetenv("TMPDIR") : ::setenv("TMPDIR", before_.c_str(), 1); }

  [[nodiscard]] std::size_t folders() const {
    const std::filesystem::directory_iterator all(home_ / "");
    return static_cast<std::size_t>(std::distance(begin(all), end(all)));
  }
  /// Runs in a process of its own. @return the status of waitpid()
  template <class Body>
  static int status_of(const Body& body) {
    const pid_t child = ::fork();
    if (child == 0) {
      try {
        body();
      } catch (...) {
        ::_exit(3);
      }
      ::_exit(0);
    }
    int status = -1;
    ::waitpid(child, &status, 0);
    return status;
  }

  TestFolder home_;
  std::string before_;
};

TEST_F(HeldFolders, ThoseOfKilledProcessesGoAtTheNextStart) {
  const std::string fmu = lag_fmu(3);
  const int status = status_of([&] {
    const auto part = ForeignFmu::load("part", "part.fmu", fmu);
    ::raise(SIGKILL);
  });
  ASSERT_TRUE(WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL);
  ASSERT_EQ(folders(), 1U) << "nothing was left behind: the test shows nothing";
  {
    const auto part = ForeignFmu::load("part", "part.fmu", fmu);
    EXPECT_EQ(folders(), 1U);  // its own
    const auto other = ForeignFmu::load("other", "part.fmu", fmu);
    EXPECT_EQ(folders(), 2U);  // those of the living stay
    EXPECT_TRUE(std::filesystem::exists(home_ / ""));
    part->begin(0, {});
  }
  EXPECT_EQ(folders(), 0U);
}

TEST_F(HeldFolders, WhatIsOfOthersStays) {
  std::filesystem::create_directory(home_ / "espalier-fmu");
  std::filesystem::create_directories(home_ / "espalier-fmu-mine/of somebody");  // no lock: not one of ours
  std::filesystem::create_directories(home_ / "elsewhere/deep");
  std::filesystem::create_directory_symlink(home_ / "elsewhere", home_ / "espalier-fmu-abcdef");
  { const HeldFolder folder("espalier-fmu", "test"); }
  EXPECT_EQ(folders(), 4U);
  EXPECT_TRUE(std::filesystem::exists(home_ / "elsewhere/deep"));
  ::setenv("TMPDIR", (home_ / "nowhere").c_str(), 1);
  EXPECT_THROW(HeldFolder("espalier-fmu", "test"), Error);
}

// Each makes, uses and removes folders while the others look for abandoned ones.
TEST_F(HeldFolders, TenProcessesStartAtOnce) {
  const std::string fmu = lag_fmu(2);
  pid_t children[10];
  for (pid_t& child : children) {
    child = ::fork();
    if (child != 0) continue;
    try {
      for (int k = 0; k < 20; ++k) {
        const auto part = ForeignFmu::load("part", "part.fmu", fmu);
        part->begin(0, {});
        part->end_initialization();
        if (!part->step(0, 0.1)) ::_exit(2);
        if (k == 19 && child == 0 && (::getpid() & 1) == 0) ::raise(SIGKILL);
      }
    } catch (const std::exception& error) {
      std::fprintf(stderr, "%s\n", error.what());
      ::_exit(3);
    }
    ::_exit(0);
  }
  for (const pid_t child : children) {
    int status = -1;
    ::waitpid(child, &status, 0);
    EXPECT_TRUE((WIFEXITED(status) && WEXITSTATUS(status) == 0) || (WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL))
        << status;
  }
  { const HeldFolder folder("espalier-fmu", "test"); }
  EXPECT_EQ(folders(), 0U);
}

}  // namespace
}  // namespace espalier::fmi
