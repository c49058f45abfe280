// Materials that cannot be are refused, each number by itself.
#include "dynamics/elements/material.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <stdexcept>

namespace espalier::dynamics {
namespace {

TEST(CheckMaterial, EveryNumberThatCannotBeIsRefused) {
  const Material steel{SolidLaw::st_venant_kirchhoff, 2.1e11, 0.3, 7850};
  EXPECT_NO_THROW(check_material(steel));
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto refused = [&](double Material::*number, double value) {
    Material m = steel;
    m.*number = value;
    EXPECT_THROW(check_material(m), std::invalid_argument) << value;
  };
  for (const double wrong : {0.0, -1.0, nan}) {
    refused(&Material::young, wrong);
    refused(&Material::density, wrong);
  }
  for (const double wrong : {-1.0, 0.5, -2.0, 0.7, nan}) refused(&Material::poisson, wrong);
}

}  // namespace
}  // namespace espalier::dynamics
