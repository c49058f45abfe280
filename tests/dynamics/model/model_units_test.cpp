// Values with units: against the same model with numbers converted by hand, and against what must be refused.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "dynamics/model/model_common.hpp"
#include "dynamics/model/read/expand.hpp"
#include "dynamics/model/units/key_dimensions.hpp"
#include "dynamics/model/units/unit_system.hpp"

namespace espalier::dynamics {
namespace {

using model::UnitSystem;
using model::Value;

double in_units_of(const std::string& system, double value, const std::string& unit) {
  return UnitSystem(system).from(value, model::parse_unit(unit));
}

TEST(ModelUnits, FactorsAreThoseOfTheirDefinitions) {
  EXPECT_EQ(in_units_of("SI", 3, "mm"), 0.003);
  EXPECT_EQ(in_units_of("SI", 210, "GPa"), 210e9);
  EXPECT_EQ(in_units_of("mm-t-s", 210, "GPa"), 210e3);
  EXPECT_EQ(in_units_of("mm-t-s", 0.54, "kg"), 0.54 / 1000);
  EXPECT_DOUBLE_EQ(in_units_of("mm-t-s", 7850, "kg/m^3"), 7.85e-9);
  EXPECT_DOUBLE_EQ(in_units_of("mm-kg-ms", 1, "kN"), 1);
  EXPECT_DOUBLE_EQ(in_units_of("mm-kg-ms", 1, "GPa"), 1);
  EXPECT_DOUBLE_EQ(in_units_of("SI", 1500, "rpm"), 50 * std::numbers::pi);
  EXPECT_DOUBLE_EQ(in_units_of("SI", 30, "deg"), std::numbers::pi / 6);
  EXPECT_DOUBLE_EQ(in_units_of("in-slinch-s", 1, "lbf"), 1);
  EXPECT_DOUBLE_EQ(in_units_of("in-slinch-s", 1, "psi"), 1);
  EXPECT_DOUBLE_EQ(in_units_of("SI", 1, "psi"), 6894.757293168361);
  EXPECT_DOUBLE_EQ(in_units_of("SI", 1, "slug"), 14.593902937206364);
  EXPECT_DOUBLE_EQ(in_units_of("cm-g-s", 1, "N"), 1e5);
  EXPECT_DOUBLE_EQ(in_units_of("SI", 2, "kg m2"), 2);
  EXPECT_DOUBLE_EQ(in_units_of("SI", 2, "kg*mm^2"), 2e-6);
  EXPECT_DOUBLE_EQ(in_units_of("SI", 5, "N/mm"), 5000);
  EXPECT_DOUBLE_EQ(in_units_of("SI", 5, "1/ms"), 5000);
  EXPECT_DOUBLE_EQ(in_units_of("SI", 2, "%"), 0.02);
}

TEST(ModelUnits, OwnUnitsOfASystem) {
  EXPECT_EQ(UnitSystem("SI").unit_of("force/length^2"), "Pa");
  EXPECT_EQ(UnitSystem("SI").unit_of("length/time"), "m/s");
  EXPECT_EQ(UnitSystem("SI").unit_of("force*length"), "N*m");
  EXPECT_EQ(UnitSystem("SI").unit_of("energy"), "J");
  EXPECT_EQ(UnitSystem("mm-t-s").unit_of("force/length^2"), "MPa");
  EXPECT_EQ(UnitSystem("s-t-mm").unit_of("force"), "N");
  EXPECT_EQ(UnitSystem("mm-kg-ms").unit_of("force"), "kN");
  EXPECT_EQ(UnitSystem("cm-g-s").unit_of("force"), "g*cm/s^2");
  EXPECT_EQ(UnitSystem("SI").unit_of("angle/time"), "rad/s");
  EXPECT_EQ(UnitSystem("SI").unit_of("1"), "1");
  EXPECT_EQ(UnitSystem("SI").unit_of(""), "");
}

/// What a unit of the system means is one of it: conversion and naming are inverse to each other, for every key.
TEST(ModelUnits, EveryKeyHasAnOwnUnit) {
  std::size_t checked = 0;
  for (const model::KeyRow& row : model::key_rows()) {
    if (row.dimension == "any" || row.dimension == "degree" || row.dimension == "1") continue;
    if (row.dimension.find("^e") != std::string_view::npos) continue;
    const std::string words(row.dimension.substr(0, row.dimension.find('|')));
    for (const char* system : {"SI", "mm-t-s", "mm-kg-ms", "cm-g-s", "in-slinch-s"}) {
      const std::string unit = UnitSystem(system).unit_of(words);
      EXPECT_EQ(model::parse_unit(unit).dimension, model::parse_dimension(words)) << words << " " << unit;
      EXPECT_NEAR(in_units_of(system, 1, unit), 1, 1e-14) << words << " " << unit;
      ++checked;
    }
  }
  EXPECT_GT(checked, 200U);
}

const std::string kWithUnits = R"toml(units = "mm-t-s"
gravity = "[0, -9.81, 0] m/s^2"
[parameters]
arm = "0.5 m"
[materials.steel]
young = "210 GPa"
poisson = "30 %"
density = "7850 kg/m^3"
[bodies.bob]
type = "rigid"
mass = "0.54 kg"
inertia = ["1e-4 kg m^2", "2e-4 kg*m^2", "100 kg mm^2"]
position = ["arm", 0, "0 mm"]
rotation = { axis = [0, 0, 1], angle = "30 deg" }
angular_velocity = ["0 rpm", 0, "60 rpm"]
[bodies.rod]
type = "beam"
start = "[0, 0, 0] m"
end = "[0, 1, 0] m"
elements = 2
radius = "1 cm"
material = "steel"
damping = { ratio = "2 %", frequencies = ["100 Hz", "1 kHz"] }
[joints.hinge]
type = "revolute"
bodies = ["ground", "bob"]
at = [0, 0, 0]
axis = [0, 0, 1]
limits = { lower = "-90 deg", upper = "2 rad", stiffness = "10 N*m", smoothing = "1 deg" }
[joints.clamp]
type = "fixed"
a = { body = "ground" }
b = { body = "rod", node = 1 }
[forces.cord]
type = "spring"
a = { body = "ground", point = "[0, 1000, 0] mm" }
b = { body = "bob" }
stiffness = "3 N/mm"
damping = "2 N s/m"
rest = "30 cm"
[forces.blow]
type = "load"
a = { body = "bob" }
force = ["1 kN", 0, "10*sin(t)"]
moment = "[0, 0, 1] N*m"
[integrator]
end = "1 ms"
[output]
quantities = ["bob.position.x", "cord.force"]
)toml";

const std::string kByHand = R"toml(gravity = [0, -9810, 0]
[parameters]
arm = 500
[materials.steel]
young = 210e3
poisson = 0.3
density = 7.85e-9
[bodies.bob]
type = "rigid"
mass = 0.54e-3
inertia = [0.1, 0.2, 0.1]
position = ["arm", 0, 0]
rotation = { axis = [0, 0, 1], angle = "pi/6" }
angular_velocity = [0, 0, "2*pi"]
[bodies.rod]
type = "beam"
start = [0, 0, 0]
end = [0, 1000, 0]
elements = 2
radius = 10
material = "steel"
damping = { ratio = 0.02, frequencies = [100, 1000] }
[joints.hinge]
type = "revolute"
bodies = ["ground", "bob"]
at = [0, 0, 0]
axis = [0, 0, 1]
limits = { lower = "-pi/2", upper = 2, stiffness = 1e4, smoothing = "pi/180" }
[joints.clamp]
type = "fixed"
a = { body = "ground" }
b = { body = "rod", node = 1 }
[forces.cord]
type = "spring"
a = { body = "ground", point = [0, 1000, 0] }
b = { body = "bob" }
stiffness = 3
damping = 2e-3
rest = 300
[forces.blow]
type = "load"
a = { body = "bob" }
force = [1000, 0, "10*sin(t)"]
moment = [0, 0, 1000]
[integrator]
end = 1e-3
[output]
quantities = ["bob.position.x", "cord.force"]
)toml";

TEST(ModelUnits, AModelWithUnitsIsTheOneConvertedByHand) {
  const Simulation measured = simulated(kWithUnits), plain = simulated(kByHand);
  EXPECT_EQ(measured.summary().units, "mm-t-s");
  EXPECT_EQ(plain.summary().units, "");
  ASSERT_EQ(measured.summary().values.size(), 4U);
  for (std::size_t k = 0; k < 4; ++k) {
    const double truth = plain.summary().values[k].second;
    EXPECT_NEAR(measured.summary().values[k].second, truth, 1e-9 * std::abs(truth) + 1e-12);
  }
  EXPECT_NEAR(measured.summary().energy_end.kinetic, plain.summary().energy_end.kinetic,
              1e-8 * plain.summary().energy_end.kinetic);
  for (const SimulationQuantity& q : measured.quantities()) {
    if (q.name == "cord.force.x") {
      EXPECT_EQ(q.unit, "N");
    } else if (q.name == "bob.velocity.x") {
      EXPECT_EQ(q.unit, "mm/s");
    }
  }
  for (const SimulationQuantity& q : plain.quantities()) EXPECT_EQ(q.unit, "");
}

TEST(ModelUnits, ValuesOfTheCommandLineTakeUnits) {
  SimulationOptions options;
  options.set = {"units=SI", "bodies.bob.mass=500 g", "parameters.way=30 cm", "bodies.bob.position=[\"way\", 0, 0]"};
  const Simulation s = simulated(kPendulum, options);
  EXPECT_NEAR(s.summary().energy_begin.potential, 0, 1e-12);
  EXPECT_EQ(s.summary().units, "SI");
}

TEST(ModelUnits, WhatIsWrongIsRefused) {
  const std::string& p = kPendulum;
  const std::string si = "units = \"SI\"\n" + p;
  const std::vector<Mistake> mistakes = {
      {"dimension",
       replaced(si, "mass = 2", "mass = \"3 mm\""),
       {"bodies.bob.mass", "dimension length", "mass is", "kg"}},
      {"list",
       replaced(si, "position = [1, 0, 0]", "position = \"[1, 0, 0] s\""),
       {"position", "length is expected", "m"}},
      {"item",
       replaced(si, "position = [1, 0, 0]", "position = [\"1 s\", 0, 0]"),
       {"position[0]", "length is expected"}},
      {"no list",
       replaced(si, "position = [1, 0, 0]", "position = \"[1, x, 0] m\""),
       {"position", "no list of numbers"}},
      {"texts",
       replaced(si, "position = [1, 0, 0]", "position = \"['a', 0, 0] m\""),
       {"position[0]", "must be a number"}},
      {"unknown", replaced(si, "mass = 2", "mass = \"3 kgg\""), {"unknown unit 'kgg'", "did you mean 'kg'"}},
      {"no system", replaced(p, "mass = 2", "mass = \"3 kg\""), {"bodies.bob.mass", "units = \"SI\""}},
      {"bad system", "units = \"metric\"\n" + p, {"units", "'metric' is no system", "mm-t-s"}},
      {"two lengths", "units = \"mm-m-s\"\n" + p, {"units of the same"}},
      {"missing", "units = \"mm-s\"\n" + p, {"no system"}},
      {"kind", "units = 3\n" + p, {"units", "must be a text"}},
      {"frequency", replaced(si, "end = 1", "end = \"2 Hz\""), {"integrator.end", "time is expected"}},
      {"plain", replaced(si, "end = 1", "end = 1\nnewton_tolerance = \"1 mm\""), {"newton_tolerance", "plain number"}},
      {"whole", replaced(si, "end = 1", "end = 1\nmax_order = \"2 mm\""), {"max_order", "plain number"}},
      {"expression", replaced(si, "mass = 2", "mass = \"2*3 kg\""), {"bodies.bob.mass", "must be a number"}},
      {"unit of nothing", replaced(si, "mass = 2", "mass = \"3 kg/\""), {"a unit is missing"}},
      {"exponent", replaced(si, "mass = 2", "mass = \"3 kg^99999999999\""), {"an exponent of 1e+11"}},
      {"no unit", replaced(p, "mass = 2", "mass = \"3 sin(1)\""), {"bodies.bob.mass", "must be a plain number"}},
      {"no vector", replaced(si, "position = [1, 0, 0]", "position = \"1 m\""), {"position", "list of three"}},
      {"huge", replaced(si, "mass = 2", "mass = \"1e999 kg\""), {"beyond the range"}},
      {"overflow", replaced(si, "mass = 2", "mass = \"1e308 t\""), {"finite"}},
      {"angle", replaced(si, "mass = 2", "mass = 2\nangular_velocity = [0, 0, \"3 Hz\"]"), {"angle/time is expected"}},
      {"parameter", si + "[parameters]\nx = \"[1, 2, 3] m\"\n", {"parameters.x", "one number"}},
      {"parameter alone", p + "[parameters]\nx = \"1 m\"\n", {"parameters.x", "units = \"SI\""}},
  };
  for (const Mistake& mistake : mistakes) {
    Simulation s;
    const Status status = s.load_text(mistake.text, "model.toml");
    EXPECT_EQ(status.code, StatusCode::invalid_input) << mistake.name;
    for (const std::string& word : mistake.says)
      EXPECT_NE(status.message.find(word), std::string::npos) << mistake.name << ": " << status.message;
  }
}

/// The same model in two systems: what is not written has to be the same length, speed or stiffness, too.
double in_metres(const std::string& system, const std::string& text, const char* quantity) {
  const Simulation s = simulated("units = \"" + system + "\"\n" + text);
  return s.value(quantity) / UnitSystem(system).from(1, model::parse_unit("m"));
}

TEST(ModelUnits, DefaultsAreTheSameInEverySystem) {
  const std::string steel = "material = { young = \"210 GPa\", density = \"7850 kg/m^3\" }\n";
  const std::string parts[] = {"block", "connecting-rod", "chain-link", "crank", "guide", "bladed-rotor", "tyre"};
  for (const std::string& part : parts) {
    const std::string text = "[bodies.b]\ntype = \"solid\"\nmesh = { part = \"" + part + "\", unknowns = 300" +
                             (part == "block" ? ", lx = \"1 m\", ly = \"1 m\", lz = \"1 m\"" : "") + " }\n" + steel +
                             "[markers.m]\nbody = \"b\"\nnode = 1\n[integrator]\nend = \"1 us\"\n";
    for (const char* quantity : {"m.position.x", "m.position.y", "m.position.z"}) {
      const double metres = in_metres("SI", text, quantity);
      EXPECT_NEAR(in_metres("mm-t-s", text, quantity), metres, 1e-9 * (1 + std::abs(metres)))
          << part << " " << quantity;
    }
  }
  const std::string creeps =
      "gravity = [\"4.9 m/s^2\", \"-8.5 m/s^2\", 0]\n[bodies.b]\ntype = \"point\"\nmass = \"1 kg\"\n"
      "[forces.g]\ntype = \"guide\"\na = { body = \"ground\" }\nb = { body = \"b\" }\nstiffness = \"1e5 N/m\"\n"
      "smoothing = \"1e-4 m\"\nfriction = 0.7\nlengths = \"[10] m\"\ncurvatures = [0]\nstart = \"[-1, 0, 0] m\"\n"
      "[integrator]\nend = \"0.3 s\"\n";
  const double crept = in_metres("SI", creeps, "b.position.x");
  EXPECT_GT(crept, 1e-4);
  EXPECT_NEAR(in_metres("mm-t-s", creeps, "b.position.x"), crept, 1e-3 * crept);
}

/// A solid's side has a stiffness by area, a sphere's has none by it.
TEST(ModelUnits, StiffnessOfAContactGoesByItsSurfaces) {
  const std::string text =
      "units = \"mm-t-s\"\n[bodies.b]\ntype = \"solid\"\nmesh = { part = \"block\", lx = 1, ly = 1, lz = 1, divisions "
      "= [1, 1, 1] }\n"
      "material = { young = 1, density = 1 }\n[surfaces.s]\nbody = \"b\"\nshape = \"faces\"\n"
      "[surfaces.f]\nbody = \"ground\"\nshape = \"plane\"\n[contacts.c]\nsurfaces = [\"s\"]\nagainst = [\"f\"]\n"
      "exponent = EXPONENT\nstiffness = \"1e8 UNIT\"\n[integrator]\nend = 1e-9\n";
  const auto said = [&](const char* exponent, const char* unit) {
    Simulation s;
    return s.load_text(replaced(replaced(text, "EXPONENT", exponent), "UNIT", unit), "model.toml").message;
  };
  EXPECT_EQ(said("1", "N/m^3"), "");
  EXPECT_EQ(said("1.5", "N/m^3.5"), "");
  EXPECT_EQ(said("\"3/2\"", "N/m^3.5"), "");
  EXPECT_NE(said("1", "N/m").find("contacts.c.stiffness"), std::string::npos);
  EXPECT_NE(said("\"3/2\"", "N/m^3").find("contacts.c.stiffness"), std::string::npos);
}

/// Texts that are no numbers stay what they are, and so does every model without units.
TEST(ModelUnits, NamesAreNoValues) {
  Value root = model::parse_toml(R"(title = "2 m of rope"
units = "SI"
[bodies.x]
type = "solid"
element_set = "3 mm"
mesh = { file = "2 mm.inp", scale = "1 %" }
[joints.k]
type = "distance"
length = "initial"
)",
                                 "m.toml");
  model::expand(root, {});
  EXPECT_EQ(root.find("title")->text, "2 m of rope");
  const Value& body = root.find("bodies")->entries[0].second;
  EXPECT_EQ(body.find("element_set")->text, "3 mm");
  EXPECT_EQ(body.find("mesh")->find("file")->text, "2 mm.inp");
  EXPECT_EQ(body.find("mesh")->find("scale")->real, 0.01);
  EXPECT_EQ(root.find("joints")->entries[0].second.find("length")->text, "initial");
}

/// Every shape in which numbers come: nested lists, repetitions, laws whose dimension follows from other keys.
TEST(ModelUnits, ListsRepetitionsAndLaws) {
  Value root = model::parse_toml(R"toml(units = "SI"
[[repeat]]
to = 2
[repeat.bodies."b{i}"]
type = "beam"
points = "[[0, 0, 0], [100, 0, 0]] mm"
position = ["{10*i} mm", 0, "5 cm"]
[bodies.k]
type = "rigid"
inertia = [["1 kg m^2", 0, 0], [0, "2 kg m^2", 0], [0, 0, "3e6 kg mm^2"]]
[contacts.ball]
stiffness = "1 N/mm^1.5"
exponent = 1.5
[contacts.pad]
stiffness = "1 MPa/mm"
[surfaces.disc]
shape = "sprocket"
tip = "35 %"
[splines.cam]
points = [["1 ms", "2 mm"], [1, "3 deg"]]
y_scale = "1 mm"
[initial]
rotation = { axis = [0, 0, 1], speed = "1500 rpm" }
[supports.led]
motion = { z = "1 um" }
[markers.m]
bore = { point = ["1 mm", 0, 0], radius = "1 in" }
[forces.x]
a = { bore = { length = "2 mm" }, rotation = { axis = [0, 0, 1], angle = "90 deg" } }
)toml",
                                 "m.toml");
  model::expand(root, {});
  const auto at = [&](const std::vector<const char*>& path) -> const Value& {
    const Value* value = &root;
    for (const char* key : path) value = value->find(key);
    return *value;
  };
  EXPECT_EQ(at({"bodies", "b2", "points"}).items[1].items[0].real, 0.1);
  EXPECT_EQ(at({"bodies", "b2", "position"}).items[0].real, 0.02);
  EXPECT_EQ(at({"bodies", "b0", "position"}).items[2].real, 0.05);
  EXPECT_DOUBLE_EQ(at({"bodies", "k", "inertia"}).items[2].items[2].real, 3);
  EXPECT_NEAR(at({"contacts", "ball", "stiffness"}).real, std::pow(1000, 1.5), 1e-9);
  EXPECT_DOUBLE_EQ(at({"contacts", "pad", "stiffness"}).real, 1e9);
  EXPECT_DOUBLE_EQ(at({"surfaces", "disc", "tip"}).real, 0.35);
  EXPECT_DOUBLE_EQ(at({"splines", "cam", "points"}).items[1].items[1].real, std::numbers::pi / 60);
  EXPECT_DOUBLE_EQ(at({"splines", "cam", "y_scale"}).real, 1e-3);
  EXPECT_DOUBLE_EQ(at({"initial", "rotation", "speed"}).real, 50 * std::numbers::pi);
  EXPECT_DOUBLE_EQ(at({"supports", "led", "motion", "z"}).real, 1e-6);
  EXPECT_DOUBLE_EQ(at({"markers", "m", "bore", "point"}).items[0].real, 1e-3);
  EXPECT_DOUBLE_EQ(at({"markers", "m", "bore", "radius"}).real, 0.0254);
  EXPECT_DOUBLE_EQ(at({"forces", "x", "a", "bore", "length"}).real, 2e-3);
  EXPECT_DOUBLE_EQ(at({"forces", "x", "a", "rotation", "angle"}).real, std::numbers::pi / 2);
}

/// Phases are degrees by themselves.
TEST(ModelUnits, PhasesAreCountedInDegrees) {
  Value root = model::parse_toml(
      "units = \"SI\"\n[harmonic.loads]\nx = { y = { amplitude = \"2 kN\", phase = \"1 rad\" } }\n"
      "z = { amplitude = 1, phase = \"90 deg\" }\n",
      "m.toml");
  model::expand(root, {});
  const Value& loads = *root.find("harmonic")->find("loads");
  EXPECT_DOUBLE_EQ(loads.find("x")->find("y")->find("phase")->real, 180 / std::numbers::pi);
  EXPECT_DOUBLE_EQ(loads.find("x")->find("y")->find("amplitude")->real, 2000);
  EXPECT_DOUBLE_EQ(loads.find("z")->find("phase")->real, 90);
}

}  // namespace
}  // namespace espalier::dynamics
