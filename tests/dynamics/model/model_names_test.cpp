// Values that a model names: read, printed and listed by the same rows. Truth: the row itself.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <set>

#include "dynamics/contact/geometry/shape.hpp"
#include "dynamics/elements/hex8_strain.hpp"
#include "dynamics/mesh/deck/deck.hpp"
#include "dynamics/model/build/curve.hpp"
#include "dynamics/model/read/value.hpp"
#include "dynamics/model/robots/robot.hpp"
#include "dynamics/model/run_spec.hpp"

namespace espalier::dynamics::model {
namespace {

/// What a text `key = "..."` gives.
template <class T, std::size_t n>
T read(const std::string& text, const base::Named<T> (&rows)[n], T otherwise) {
  const Value root = parse_toml(text, "model.toml");
  return Section(root).one_of("key", rows, otherwise);
}

template <class T, std::size_t n>
void expect_round_trips(const base::Named<T> (&rows)[n]) {
  std::set<std::string> names;
  for (const auto& row : rows) {
    EXPECT_TRUE(names.insert(row.name).second) << row.name << " names two values";
    const T other = rows[row.value == rows[0].value ? n - 1 : 0].value;
    EXPECT_EQ(read(fmt::format("key = \"{}\"", row.name), rows, other), row.value) << row.name;
    EXPECT_EQ(read("", rows, row.value), row.value) << row.name;
    EXPECT_STREQ(name_of(rows, row.value), row.name);
  }
  try {
    (void)read("key = \"no such name\"", rows, rows[0].value);
    FAIL() << "a name that no row has was read";
  } catch (const Error& error) {
    for (const auto& row : rows) EXPECT_NE(std::string(error.what()).find(row.name), std::string::npos) << error.what();
  }
}

TEST(ModelNames, EveryRowIsReadAndPrintedByItsName) {
  expect_round_trips(kHex8Formulations);
  expect_round_trips(kSolidLaws);
  expect_round_trips(kBdfIterations);
  expect_round_trips(kMethods);
  expect_round_trips(kStaticPaths);
  expect_round_trips(kPictureFormats);
  expect_round_trips(kAttachments);
  expect_round_trips(kCurveKinds);
  expect_round_trips(kCurveOutsides);
  expect_round_trips(kDeckWords);
  expect_round_trips(robots::kGeomKinds);
}

TEST(ModelNames, AValueWithoutARowHasNoName) {
  EXPECT_STREQ(name_of(kStaticPaths, StaticPath::linear), "");
  EXPECT_STREQ(name_of(kDeckWords, DeckKind::others), "");
}

}  // namespace
}  // namespace espalier::dynamics::model
