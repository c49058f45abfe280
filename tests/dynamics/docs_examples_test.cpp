// Every model on the pages about forces and contact runs to its end.
#include <gtest/gtest.h>

#include "model_common.hpp"
#include "places.hpp"

namespace espalier::dynamics {
namespace {

const std::string kPage = (espalier::test::source_folder() / "docs/guide/forces.md").string();

/// The fenced blocks of a page in one language.
std::vector<std::string> blocks(const std::string& page, const std::string& language) {
  std::vector<std::string> result;
  const std::string fence = "```" + language + "\n";
  for (std::size_t at = page.find(fence); at != std::string::npos; at = page.find(fence, at)) {
    at += fence.size();
    result.push_back(page.substr(at, page.find("```", at) - at));
  }
  return result;
}

TEST(DocsExamples, OfForcesRun) {
  const std::string page = content_of(kPage);
  const ScratchFolder folder;
  for (const std::string& csv : blocks(page, "csv"))  // "# name.csv" comes first
    std::ofstream(folder.path() + "/" + csv.substr(2, csv.find('\n') - 2)) << csv;
  const std::vector<std::string> models = blocks(page, "toml");
  EXPECT_EQ(models.size(), 4U);
  for (std::size_t k = 0; k < models.size(); ++k) {
    const std::string path = folder.path() + "/model.toml";
    std::ofstream(path) << models[k];
    Simulation s;
    Status status = s.load(path);
    if (status.ok()) status = s.run();
    EXPECT_TRUE(status.ok()) << "example " << k + 1 << ": " << status.message;
    EXPECT_GT(s.summary().steps, 10) << k + 1;
  }
}

TEST(DocsExamples, OfContactRun) {
  const std::string page = content_of((espalier::test::source_folder() / "docs/guide/contact.md").string());
  const std::vector<std::string> models = blocks(page, "toml");
  EXPECT_EQ(models.size(), 2U);
  for (const std::string& text : models) EXPECT_GT(simulated(text).summary().steps, 10);
}

}  // namespace
}  // namespace espalier::dynamics
