// FMUs of other programs: what is loaded, and what is refused.
#include "fmi/foreign.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "espalier/types.hpp"
#include "fmus.hpp"

namespace espalier::fmi {
namespace {

std::string load_message(const std::string& bytes) {
  try {
    (void)ForeignFmu::load("part", "part.fmu", bytes);
  } catch (const Error& error) {
    return error.what();
  }
  return "loaded";
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

class ForeignVersions : public ::testing::TestWithParam<int> {};

TEST_P(ForeignVersions, StepsAsItsEquation) {
  const auto fmu = ForeignFmu::load("part", "part.fmu", lag_fmu(GetParam()));
  const auto& d = fmu->description();
  EXPECT_EQ(d.version, GetParam());
  ASSERT_EQ(d.variables.size(), 9U);
  EXPECT_TRUE(d.serializes_state);
  fmu->begin(0.5, {{*d.find("gain"), 3.0}, {*d.find("T"), 0.2}});
  fmu->end_initialization();
  fmu->set(*d.find("u"), 2);
  double t = 0.5;
  std::string state;
  for (int k = 0; k < 10; ++k, t += 0.05) {
    if (k == 4) state = fmu->save();
    ASSERT_TRUE(fmu->step(t, 0.05));
  }
  const double at_end = fmu->get(*d.find("y"));
  EXPECT_NEAR(at_end, 6 * (1 - std::exp(-0.5 / 0.2)), 1e-14);
  EXPECT_EQ(fmu->get(*d.find("count")), 10);
  EXPECT_EQ(fmu->get(*d.find("is.high")), 1);
  fmu->restore(state);
  EXPECT_EQ(fmu->get(*d.find("count")), 4);
  t = 0.7;
  for (int k = 4; k < 10; ++k, t += 0.05) ASSERT_TRUE(fmu->step(t, 0.05));
  EXPECT_EQ(fmu->get(*d.find("y")), at_end);
  fmu->set(*d.find("enable"), 0);
  ASSERT_TRUE(fmu->step(t, 0.05));
  EXPECT_NEAR(fmu->get(*d.find("y")), at_end * std::exp(-0.25), 1e-14);
}

TEST_P(ForeignVersions, TwoInstancesKnowNothingOfEachOther) {
  const auto one = ForeignFmu::load("one", "part.fmu", lag_fmu(GetParam()));
  const auto two = ForeignFmu::load("two", "part.fmu", lag_fmu(GetParam()));
  const auto& d = one->description();
  one->begin(0, {{*d.find("gain"), 5.0}});
  two->begin(0, {});
  EXPECT_EQ(one->get(*d.find("gain")), 5);
  EXPECT_EQ(two->get(*d.find("gain")), 1);
}

TEST_P(ForeignVersions, ErrorsNameTheFmuTheCallAndWhatItSays) {
  const auto fmu = ForeignFmu::load("part", "part.fmu", lag_fmu(GetParam()));
  const auto& d = fmu->description();
  const auto fails = [&](const std::string& mischief) -> std::string {
    fmu->begin(0, {{*d.find("at"), 0.15}, {*d.find("mischief"), mischief}});
    fmu->end_initialization();
    try {
      for (int k = 0; k < 3; ++k)
        if (!fmu->step(0.1 * k, 0.1)) return "ended after " + std::to_string(k + 1);
    } catch (const Error& error) {
      return error.what();
    }
    return "went on";
  };
  const std::string error = fails("error");
  const std::string call = GetParam() == 2 ? "fmi2DoStep" : "fmi3DoStep";
  EXPECT_NE(error.find("FMU 'part' (part.fmu): " + call + " failed; the FMU says: a valve broke"), std::string::npos)
      << error;
  EXPECT_NE(fails("discard").find("was discarded"), std::string::npos);
  EXPECT_EQ(fails("end"), "ended after 2");
  EXPECT_EQ(fails(""), "went on");
  if (GetParam() == 3) {
    EXPECT_NE(fails("early").find("came back"), std::string::npos);
  }
  EXPECT_THROW(fmu->begin(0, {{*d.find("T"), -1.0}}), Error);
}

// A number that would turn into another one on its way does not go there.
TEST_P(ForeignVersions, NumbersThatDoNotFitAreRefused) {
  const auto fmu = ForeignFmu::load("part", "part.fmu", lag_fmu(GetParam()));
  const auto& d = fmu->description();
  const auto told = [&](const std::string& name, double value) -> std::string {
    try {
      fmu->begin(0, {{*d.find(name), value}});
    } catch (const Error& error) {
      return error.what();
    }
    return "taken";
  };
  EXPECT_NE(told("count", 3e9).find("'count' cannot be 3000000000: its type"), std::string::npos) << told("count", 3e9);
  EXPECT_NE(told("gain", std::nan("")).find("'gain' cannot be nan"), std::string::npos);
  EXPECT_EQ(told("gain", 3e9), "taken");
}

// Nothing can be caught there; but the last line says who it was.
TEST_P(ForeignVersions, ACrashNamesTheFmuAndTheCall) {
  ::testing::FLAGS_gtest_death_test_style = "threadsafe";
  const auto crash = [] {
    const auto fmu = ForeignFmu::load("part", "part.fmu", lag_fmu(GetParam()));
    const auto& d = fmu->description();
    fmu->begin(0, {{*d.find("at"), 0.05}, {*d.find("mischief"), std::string("crash")}});
    fmu->end_initialization();
    (void)fmu->step(0, 0.1);
  };
  EXPECT_DEATH(crash(), "espalier: FMU 'part' .part.fmu.: crashed in fmi.DoStep");
}

TEST_P(ForeignVersions, RefusesWhatItCannotRun) {
  const bool three = GetParam() == 3;
  const std::string xml = lag_description(GetParam());
  const std::string home = three ? "binaries/x86_64-linux/" : "binaries/linux64/";
  const std::string so = bytes_of_file(TEST_LAG_LIBRARY);
  const auto with = [&](const std::string& description) {
    return load_message(make_zip({{"modelDescription.xml", description}, {home + "lag.so", so}}));
  };
  EXPECT_EQ(with(xml), "loaded");
  const std::string version = three ? "fmiVersion=\"3.0\"" : "fmiVersion=\"2.0\"";
  EXPECT_NE(with(replaced(xml, version, "fmiVersion=\"1.0\"")).find("it is of FMI 1.0"), std::string::npos);
  EXPECT_NE(with(replaced(xml, version, "")).find("no version"), std::string::npos);
  EXPECT_NE(with(replaced(xml, "CoSimulation", "ModelExchange")).find("for model exchange alone"), std::string::npos);
  EXPECT_NE(with(replaced(xml, "modelIdentifier=\"lag\"", "modelIdentifier=\"../lag\"")).find("names no binary"),
            std::string::npos);
  EXPECT_NE(with(xml.substr(0, xml.size() / 2)).find("is damaged"), std::string::npos);
  EXPECT_NE(with("<a/>").find("describes no FMU"), std::string::npos);
  for (const char* reference : {"y", "2y", "-2", "99999999999", ""})
    EXPECT_NE(with(replaced(xml, "valueReference=\"2\"", fmt::format("valueReference=\"{}\"", reference)))
                  .find("the reference of 'y' is no number of 32 bits"),
              std::string::npos)
        << reference;
  EXPECT_NE(with(replaced(xml, "name=\"gain\"", "name=\"T\"")).find("two variables 'T'"), std::string::npos);
  EXPECT_NE(load_message(make_zip({{"modelDescription.xml", xml}, {"binaries/win64/lag.dll", "x"}}))
                .find("no binary for this platform, " + home + "lag.so; it has binaries for: win64"),
            std::string::npos);
  EXPECT_NE(
      load_message(make_zip({{"modelDescription.xml", xml}, {home + "lag.so", "no program"}})).find("cannot be loaded"),
      std::string::npos);
  EXPECT_NE(load_message(make_zip({{"readme", xml}})).find("no 'modelDescription.xml'"), std::string::npos);
  EXPECT_NE(load_message("text").find("no ZIP archive"), std::string::npos);
  const std::string token = three ? "{lag-3}" : "{lag-2}";
  const auto other = ForeignFmu::load(
      "part", "part.fmu", make_zip({{"modelDescription.xml", replaced(xml, token, "{x}")}, {home + "lag.so", so}}));
  EXPECT_THROW(other->begin(0, {}), Error);
}

INSTANTIATE_TEST_SUITE_P(Foreign, ForeignVersions, ::testing::Values(2, 3));

}  // namespace
}  // namespace espalier::fmi
