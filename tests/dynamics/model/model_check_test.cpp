// Checks of a model's text without a run. Truth: the reader's own messages, and models of the repository.
#include <gtest/gtest.h>

#include "espalier/model_text.hpp"

namespace espalier {
namespace {

const std::string kBob = "[bodies.bob]\ntype = \"point\"\nmass = 2\n";

TEST(ModelCheck, NeedsNoRunAndFindsWhatIsWrong) {
  EXPECT_TRUE(check_model_text(kBob, "m").ok());
  EXPECT_EQ(check_model_text(kBob, "m", {"bodies.bob.mass=-1"}).code, StatusCode::invalid_input);
  EXPECT_EQ(check_model_text("", "m").code, StatusCode::invalid_input);
  EXPECT_EQ(check_model("/none/m.toml").code, StatusCode::invalid_input);
}

TEST(ModelCheck, NamesOfOtherPartsMustBeThere) {
  const auto said = [](const std::string& more) { return check_model_text(kBob + more, "m").message; };
  const std::string joint = "[joints.j]\ntype = \"spherical\"\n";
  EXPECT_EQ(said(joint + "bodies = [\"ground\", \"bob\"]\nat = [0, 0, 0]\n"), "");
  EXPECT_EQ(said(joint + "bodies = [\"ground\", \"bib\"]\nat = [0, 0, 0]\n"),
            "m:6: joints.j.bodies: unknown body 'bib'; did you mean 'bob'?");
  EXPECT_NE(said(joint + "a = \"mark\"\nb = { body = \"bob\" }\n[markers.marc]\nbody = \"bob\"\n")
                .find("did you mean 'marc'?"),
            std::string::npos);
  EXPECT_EQ(said("[surfaces.ball]\nbody = \"bob\"\nshape = \"sphere\"\nradius = 1\n[contacts.c]\nsurfaces = [\"ba*\", "
                 "\"bull\"]\nstiffness = 1\n"),
            "m:8: contacts.c: unknown surface 'bull'; did you mean 'ball'?");
}

TEST(ModelCheck, UnknownKeysComeBeforeMissingOnes) {
  const std::string head = "[bodies.bob]\ntype = \"rigid\"\nmass = 2\n";
  EXPECT_EQ(check_model_text(head + "bx = [1, 1, 1]\n", "m").message,
            "m:4: bodies.bob.bx: unknown key; did you mean 'box'?");
  EXPECT_EQ(check_model_text(head, "m").message,
            "m:1: bodies.bob: needs 'inertia', or 'box' = [x, y, z], from which it follows");
  EXPECT_EQ(check_model_text(kBob + "[forces.f]\ntype = \"load\"\n[integratr]\nend = 1\n", "m").message,
            "m:6: integratr: unknown key; did you mean 'integrator'?");
}

TEST(ModelCheck, APartAloneTakesWhatItRefersToAsThere) {
  const auto said = [](const std::string& section, const std::string& text) {
    return check_model_part(section, "p", text, "model").message;
  };
  EXPECT_EQ(said("bodies", "bodies.p = { type = \"point\", mass = 1 }"), "");
  EXPECT_EQ(said("bodies", "bodies.p = { type = \"point\", mass = \"2*later\" }"), "");
  EXPECT_NE(said("bodies", "bodies.p = { type = \"point\", mass = \"2*lengt\" }\nparameters.length = 1").find("length"),
            std::string::npos);
  EXPECT_EQ(said("bodies", "bodies.p = { type = \"point\", mass = -1 }"),
            "bodies.p.mass: must be greater than 0, not -1");
  EXPECT_EQ(said("events", "events.p = { when = \"t > 1\", set = { push = 1 }, on = [\"f\"] }"), "");
}

TEST(ModelCheck, TreesKeepOrderAndKinds) {
  EXPECT_EQ(model_as_json("b = 1\na = [1.0, true, \"x\"]\n[t]\nk = inf\n", "m"),
            R"({"b":1,"a":[1.0,true,"x"],"t":{"k":Infinity}})");
  EXPECT_THROW((void)model_as_json("a = [", "m"), Error);
}

}  // namespace
}  // namespace espalier
