// What lies in an FMU of ours beside the model: a program without GPUs, and the licences of all that it is made of.
#include <gtest/gtest.h>

#include <map>

#include "dynamics/model/fmu/library.hpp"
#include "espalier/fmu.hpp"
#include "fmi/foreign.hpp"
#include "fmus.hpp"

namespace espalier::fmi {
namespace {

constexpr const char* kMass =
    "[bodies.m]\ntype = \"point\"\nmass = 1\n[integrator]\nend = 1\n[output]\nquantities = [\"m.position\"]\n";

class ExportedContents : public ::testing::TestWithParam<int> {
 protected:
  [[nodiscard]] std::string bytes() const {
    FmuOptions o;
    o.version = GetParam();
    o.library = TEST_FMU_LIBRARY;
    const FmuResult r = export_fmu_of_text(kMass, folder_ / "m.toml", folder_ / "m.fmu", o);
    EXPECT_TRUE(r.status.ok()) << r.status.message;
    return bytes_of_file(r.path);
  }
  TestFolder folder_;
};

// The standards' place for them, and their file to begin with.
TEST_P(ExportedContents, LicencesOfAllThatIsInIt) {
  const std::string fmu = bytes();
  EXPECT_LT(fmu.size(), 15'000'000U);
  const ZipArchive archive("m.fmu", fmu);
  const std::string home = "documentation/licenses/", list = archive.read(home + "license.txt");
  EXPECT_NE(archive.read(home + "espalier.txt").find("Apache License"), std::string::npos);
  const std::map<std::string, std::string> known = {
      {"libfmt.so", "fmt"}, {"libpugixml.so", "pugixml"}, {"libz.so", "zlib"}, {"libhwy.so", "highway"}};
  std::size_t libraries = 0;
  for (const std::string& name : archive.names()) {
    if (!name.starts_with("binaries/") || name.ends_with("/m.so")) continue;
    const std::string file = name.substr(name.rfind('/') + 1);
    const auto it = known.find(file.substr(0, file.find(".so") + 3));
    ASSERT_NE(it, known.end()) << file << " goes with FMUs: apps/fmu/licenses.txt has to name it";
    EXPECT_NE(list.find(" " + it->second + ".txt "), std::string::npos) << it->second;
    ++libraries;
  }
  for (const char* header_only : {"Eigen ", "three.js ", "dygraphs ", "zlib ", "{fmt} "})
    EXPECT_NE(list.find(std::string("\n") + header_only), std::string::npos) << header_only;
  if (std::filesystem::exists("/usr/share/doc/libpugixml-dev/copyright")) {  // Debian, Ubuntu
    EXPECT_EQ(archive.read(home + "pugixml.txt"), bytes_of_file("/usr/share/doc/libpugixml-dev/copyright"));
    EXPECT_GT(libraries, 0U);
  }
}

// In a build with CUDA, too: the registry of the FMU's own answers, and nothing of CUDA is linked.
TEST_P(ExportedContents, ComputesOnTheHost) {
  const std::string library = bytes_of_file(TEST_FMU_LIBRARY);
  EXPECT_LT(library.size(), 40'000'000U);
  for (const char* of_cuda : {".nv_fatbin", "libcudart", "cudaLaunchKernel", "cudaErrorMemoryAllocation"})
    EXPECT_EQ(library.find(of_cuda), std::string::npos) << of_cuda;
  for (const auto& [name, path] : dynamics::model::fmu_binaries(TEST_FMU_LIBRARY, "m.so"))
    EXPECT_EQ(name.find("cuda"), std::string::npos) << name;
  // An FMU that was tampered with so as to ask for a GPU.
  const ZipArchive archive("m.fmu", bytes());
  std::vector<ZipMember> members;
  for (const std::string& name : archive.names()) members.push_back({name, archive.read(name)});
  for (ZipMember& m : members)
    if (m.name == "resources/model.toml") m.bytes += "[solver]\ndevice = \"gpu:0\"\n";
  const auto fmu = ForeignFmu::load("m", "m.fmu", make_zip(members));
  std::string message;
  try {
    fmu->begin(0, {});
    fmu->end_initialization();
  } catch (const Error& error) {
    message = error.what();
  }
  EXPECT_NE(message.find("an FMU computes on the host"), std::string::npos) << message;
}

INSTANTIATE_TEST_SUITE_P(Export, ExportedContents, ::testing::Values(2, 3));

}  // namespace
}  // namespace espalier::fmi
