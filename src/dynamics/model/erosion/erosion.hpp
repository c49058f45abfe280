/// \file
/// Elements of solids that fail: which, when, and what becomes of the motion.
///
/// An element fails at the end of an accepted step where a limit of its body is passed at one of the points at which
/// its strains are known (ElementGroup::sample(): points of integration, of second order those where stresses are
/// best). One point is enough, as in LS-DYNA's *MAT_ADD_EROSION with its default NUMFIP = 1 and in Abaqus/Explicit,
/// which takes a solid element out where any one of its points has failed. It then has no stiffness and no stress for
/// good. Its mass stays with its nodes, lumped (ElementAssembly::element_mass()), so that what it held together comes
/// apart.
///
/// The momentum of an element does not change as it fails. Lumped, its mass would have another one at the same
/// velocities; impulses J_a = m_a (c + w x r_a) on its nodes, m_a the lumped masses and r_a the arms from their centre,
/// make up for it: c and w follow from what lacks of linear and angular momentum. Velocities take the impulses of all
/// elements at once, under the constraints: M dv + Phi_q^T mu = J, Phi_q dv = 0.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "dynamics/dae/equations.hpp"
#include "dynamics/model/fields/sampled_body.hpp"
#include "dynamics/model/mechanism.hpp"

namespace espalier::dynamics::model {

/// A component without unknowns that keeps what has failed, so that it goes into restart files.
class Erosion final : public Component, public Remembers {
 public:
  /// @param mechanism  outlives it
  explicit Erosion(Mechanism& mechanism) : Component("erosion"), mechanism_(mechanism) {}
  /// @pre the body has limits
  void add(const BuiltBody& body);

  /// What at least one element that has not failed passes at a state. @return whether there is one
  [[nodiscard]] bool find_failing(const State& s);
  /// Lets what the last find_failing() has found fail: masses, patterns, and velocities of the state, which is the one
  /// looked at. Accelerations and multipliers are to be made anew.
  void fail(Equations& equations, State& state);

  /// How many of a body's elements have failed, where it stays; null: they cannot.
  [[nodiscard]] const double* failed_elements(const std::string& body) const;
  /// Energy that was lost as elements failed: of their strain, and what the motion lost as mass was lumped.
  [[nodiscard]] double lost_energy() const { return energy_; }
  /// A line for each body with elements that have failed.
  [[nodiscard]] std::vector<std::string> notices() const;
  /// When the elements of a body failed, in the order of its assembly; infinite: not yet. Null: they cannot.
  [[nodiscard]] const std::vector<double>* failed_at(const std::string& body) const;

  [[nodiscard]] Sizes sizes() const override { return {}; }
  void declare(PatternBuilder& /*w*/, PatternBuilder& /*phi_q*/) const override {}
  void bind(const SparsePattern& /*w*/, const SparsePattern& /*phi_q*/) override {}
  void residual(const StateView& /*s*/, Span /*f*/) override {}
  void tangent(const StateView& /*s*/, const TangentWeights& /*weights*/, Span /*w_values*/) override {}
  void save(std::vector<double>& out) const override;
  void restore(ConstSpan& in) override;

  enum class Limit { strain, stress, principal_stress };

 private:
  /// An element at its worst point.
  struct Passed {
    Index element = -1;
    Limit limit = Limit::strain;
    double value = 0, share = 1;  // share: of the limit
  };
  struct Body {
    const BuiltBody* built;
    FlexibleBody* body;
    std::unique_ptr<const SampledBody> samples;
    std::vector<double> failed_at;  // of each element
    double count = 0;               // of those that have failed
    Passed first;                   // that failed
    std::vector<Passed> passed;     // found by find_failing()
  };
  [[nodiscard]] const Body* find(const std::string& body) const;
  [[nodiscard]] static Passed worst_of(const Body& body, Index element, const FieldTable& table, std::size_t row);
  static void look_at(Body& body, const State& s, base::ThreadPool* pool);
  static void add_impulses(const Body& body, const State& s, Span impulse);
  static void mark(Body& body);

  Mechanism& mechanism_;
  std::vector<Body> bodies_;
  double energy_ = 0;
};

/// For the bodies of a mechanism that have limits; none where no body has. To be called when all bodies stand.
void add_erosion(Mechanism& out);

}  // namespace espalier::dynamics::model
