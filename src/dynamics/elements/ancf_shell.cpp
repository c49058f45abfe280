#include "dynamics/elements/ancf_shell.hpp"

#include "dynamics/elements/lanes/ancf_shell_block.hpp"
#include "dynamics/elements/solid.hpp"

namespace espalier::dynamics {
namespace {

constexpr int kNodes = 4;
constexpr int kShellDofs = 24;

/// Nodes of the hexahedron: x_a = r_a - half d_a, x_(a+4) = r_a + half d_a.
void to_hexahedron(const double* shell, double half, double* hex) {
  for (int a = 0; a < kNodes; ++a)
    for (int i = 0; i < 3; ++i) {
      const double r = shell[6 * a + i], d = half * shell[6 * a + 3 + i];
      hex[3 * a + i] = r - d;
      hex[3 * (a + kNodes) + i] = r + d;
    }
}

}  // namespace

bool evaluate_shell(const Material& material, double thickness, const ElementInput& in, ElementOutput& out) {
  const ShellLaw law{law_of(Hex8Formulation::shell, material), thickness};
  return evaluate_one(2 * kNodes, in, out, [&](const BlockInput& state, const BlockOutput& result) {
    return scalar_shell_kernel().evaluate(law, state, result);
  });
}

void shell_to_hexahedron(const double* shell, double thickness, double* hex) {
  to_hexahedron(shell, 0.5 * thickness, hex);
}

bool sample_shell(const Material& material, double thickness, const double* reference, const double* position,
                  ElementSamples& out) {
  double from[kShellDofs], to[kShellDofs];
  to_hexahedron(reference, 0.5 * thickness, from);
  to_hexahedron(position, 0.5 * thickness, to);
  return sample_hex8(Hex8Formulation::shell, material, from, to, out);
}

void shell_mass(double density, double thickness, const double* reference, double* m) {
  constexpr int kVertices = 2 * kNodes;
  double hex[kShellDofs], mass[kVertices * kVertices], half = 0.5 * thickness;
  to_hexahedron(reference, half, hex);
  solid_mass(ElementType::hex8, density, hex, mass);
  const auto entry = [&](int a, int b) { return mass[b * kVertices + a]; };
  for (int a = 0; a < kNodes; ++a)
    for (int b = 0; b < kNodes; ++b) {
      const double bb = entry(a, b), bt = entry(a, b + kNodes), tb = entry(a + kNodes, b),
                   tt = entry(a + kNodes, b + kNodes);
      double* block = m + 2 * b * kVertices + 2 * a;
      block[0] = bb + bt + tb + tt;                              // (r_a, r_b)
      block[1] = half * (tt + tb - bt - bb);                     // (d_a, r_b)
      block[kVertices] = half * (tt - tb + bt - bb);             // (r_a, d_b)
      block[kVertices + 1] = half * half * (tt - tb - bt + bb);  // (d_a, d_b)
    }
}

}  // namespace espalier::dynamics
