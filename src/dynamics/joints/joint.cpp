#include "dynamics/joints/joint.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "base/at.hpp"
#include "dynamics/bodies/rigid_body.hpp"

namespace espalier::dynamics {

namespace {

constexpr double kTwoPi = 2 * std::numbers::pi;

}  // namespace

void evaluate(const JointRow::Term& term, const FrameMotion& a, const FrameMotion& b, bool rates, RelativeValue& out) {
  if (term.plain()) return evaluate(term.kind, term.i, term.j, a, b, rates, out);
  if (term.function) return term.function->evaluate(a, b, rates, out);
  evaluate(*term.rolling, static_cast<RollingDirection>(term.i), a, b, rates, out);
}

void add_curvature(const JointRow::Term& term, const FrameMotion& a, const FrameMotion& b, double factor, Mat12& k) {
  if (term.plain()) return add_curvature(term.kind, term.i, term.j, a, b, factor, k);
  if (term.function) return term.function->add_curvature(a, b, factor, k);
  add_curvature(*term.rolling, static_cast<RollingDirection>(term.i), a, b, factor, k);
}

Joint::Joint(std::string kind, std::string name, std::vector<std::unique_ptr<Frame>> frames, std::vector<JointRow> rows)
    : Component(std::move(name)), kind_(std::move(kind)), rows_(std::move(rows)) {
  for (auto& frame : frames) {
    if (!frame) throw std::invalid_argument(kind_ + " \"" + this->name() + "\": a frame is missing");
    frames_.push_back({std::move(frame), {}, {}, {}});
  }
  bool couples_translation = false, couples_rotation = false;
  for (const JointRow& row : rows_) {
    turns_.emplace_back(row.terms.size());
    offsets_.push_back(row.offset);
    driven_ = driven_ || row.driven;
    for (const JointRow::Term& term : row.terms) {
      counts_turns_ = counts_turns_ || (term.turns() && row.terms.size() > 1);
      const bool apart = !term.plain();
      const bool directions = term.kind == Relative::dot || term.kind == Relative::angle || term.kind == Relative::bend;
      couples_translation = couples_translation || apart || curves_in_translation(term.kind);
      couples_rotation = couples_rotation || apart || directions;
      const bool turns_a = apart || (term.kind != Relative::global && term.kind != Relative::distance);
      const bool turns_b = term.rolling || (term.function ? term.function->turns_b() : directions);
      if ((turns_a && !frames_.at(at(term.a)).frame->has_rotation()) ||
          (turns_b && !frames_.at(at(term.b)).frame->has_rotation())) {
        throw std::invalid_argument(
            kind_ + " \"" + this->name() +
            "\" needs a frame with axes; attach it to a rigid body or to a face, not to a node");
      }
    }
  }
  std::vector<const Frame*> plain;
  for (const Attached& f : frames_) plain.push_back(f.frame.get());
  blocks_ = FrameBlocks(std::move(plain), {!couples_translation, couples_rotation});
}

std::string Joint::constraint_name(Index local_row) const {
  return kind_ + " \"" + name() + "\", " + rows_.at(static_cast<std::size_t>(local_row)).label;
}

void Joint::declare(PatternBuilder& w, PatternBuilder& phi_q) const {
  for (const Attached& f : frames_)
    for (Index r = 0; r < sizes().constraints; ++r)
      for (const Index c : f.frame->coordinates()) phi_q.add(placement().c + r, c);
  blocks_.declare(w);
}

void Joint::bind(const SparsePattern& w, const SparsePattern& phi_q) {
  for (Attached& own : frames_) {
    const auto coordinates = own.frame->coordinates();
    own.projected.assign(rows_.size() * coordinates.size(), 0.0);
    own.position.clear();
    for (Index r = 0; r < sizes().constraints; ++r) {
      for (const Index c : coordinates) {
        own.position.push_back(c < 0 ? 0 : static_cast<std::size_t>(find_entry(phi_q, placement().c + r, c)));
      }
    }
  }
  phi_q_begin_ = static_cast<std::size_t>(phi_q.ptr[at(placement().c)]);
  phi_q_count_ = static_cast<std::size_t>(phi_q.ptr[at(placement().c + sizes().constraints)]) - phi_q_begin_;
  bind_rigid_pair(w);
  if (!pair_) blocks_.bind(w, pool());
  gradients_.assign(6 * frames_.size() * rows_.size(), 0.0);
}

namespace {

// Axes are those of the frame in body axes.
struct RigidSide {
  RigidPair::Side side;
  Mat3 axes;
};

std::optional<RigidSide> rigid_side(const Frame& frame) {
  if (const auto* rigid = dynamic_cast<const RigidFrame*>(&frame)) {
    const Placement& at = rigid->body().placement();
    return RigidSide{{at.q, at.v, rigid->point()}, rigid->rotation()};
  }
  if (dynamic_cast<const GroundFrame*>(&frame) == nullptr) return std::nullopt;
  FrameMotion motion;
  frame.motion({}, {}, motion);
  return RigidSide{{-1, -1, motion.r}, motion.rot};
}

}  // namespace

// Two rigid bodies, the one with the lower coordinates first, and rows of one plain term each: RigidPair's entries are
// then those of Phi_q, one after the other.
void Joint::bind_rigid_pair(const SparsePattern& w) {
  pair_.reset();
  if (frames_.size() != 2) return;
  const auto a = rigid_side(*frames_[0].frame), b = rigid_side(*frames_[1].frame);
  if (!a || !b || (b->side.v >= 0 && a->side.v >= b->side.v)) return;
  std::vector<RigidPair::Row> rows;
  for (const JointRow& row : rows_) {
    if (row.terms.size() != 1 || row.measure_offset || !row.terms.front().plain()) return;
    const JointRow::Term& term = row.terms.front();
    if (!RigidPair::knows(term.kind) || term.factor != 1 || term.a != 0 || term.b != 1) return;
    const bool global = term.kind == Relative::global;
    rows.push_back({term.kind, term.i, global ? Vec3(Vec3::Zero()) : Vec3(a->axes.col(term.i)),
                    term.kind == Relative::dot ? Vec3(b->axes.col(term.j)) : Vec3(Vec3::Zero())});
  }
  pair_.emplace(a->side, b->side, std::move(rows));
  pair_->bind(w);
}

void Joint::evaluate_frames(ConstSpan q, ConstSpan v) {
  for (Attached& f : frames_) f.frame->motion(q, v, f.motion);
}

void Joint::residual(const StateView& /*s*/, Span /*f*/) {}

// The counter after the motion in frames_ has been accepted.
TurnCounter Joint::followed(const JointRow::Term& term, TurnCounter turns, double t) const {
  const FrameMotion &a = frames_[at(term.a)].motion, &b = frames_[at(term.b)].motion;
  RelativeValue angle;
  evaluate(term.kind, term.i, term.j, a, b, false, angle);
  double rate = 0;
  for (Eigen::Index i = 0; i < 3; ++i)
    rate += angle.c[at(3 + static_cast<int>(i))] * a.omega[i] + angle.c[at(9 + static_cast<int>(i))] * b.omega[i];
  for (Eigen::Index i = 0; term.kind == Relative::polar && i < 3; ++i)
    rate += angle.c[at(static_cast<int>(i))] * a.vel[i] + angle.c[at(6 + static_cast<int>(i))] * b.vel[i];
  turns.accept(angle.value, rate, t);
  return turns;
}

void Joint::branches(const StateView& s, Branches& out) const {
  for (const JointRow& row : rows_)
    if (row.driven && row.function.branches) row.function.branches(s.t, out);
}

void Joint::accept(const StateView& s) {
  if (!counts_turns_ && !spin_ && !memory_) return;
  evaluate_frames(s.q, s.v);
  if (memory_) memory_->accept(frames_[0].motion, frames_[1].motion);
  if (spin_) spin_ = followed({Relative::angle}, *spin_, s.t);
  for (std::size_t r = 0; counts_turns_ && r < rows_.size(); ++r) {
    for (std::size_t k = 0; k < rows_[r].terms.size(); ++k) {
      if (rows_[r].terms[k].turns()) turns_[r][k] = followed(rows_[r].terms[k], turns_[r][k], s.t);
    }
  }
}

// Evaluates one term at the frames' motion: adds its value to phi and, for gamma, its curvature.
void Joint::add_term(std::size_t r, std::size_t k, bool rates, RelativeValue& value, Sum& sum) const {
  const JointRow::Term& term = rows_[r].terms[k];
  const FrameMotion &a = frames_[at(term.a)].motion, &b = frames_[at(term.b)].motion;
  evaluate(term, a, b, rates, value);
  const bool counted = term.turns() && rows_[r].terms.size() > 1;
  sum.phi += term.factor * (counted ? turns_[r][k].unwrapped(value.value, sum.t) : value.value);
  if (!rates) return;
  const Row12& c = value.c;
  double bias = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    const auto e = static_cast<Eigen::Index>(i);
    bias += c[i] * a.bias_acc[e] + c[3 + i] * a.bias_alpha[e] + c[6 + i] * b.bias_acc[e] + c[9 + i] * b.bias_alpha[e];
  }
  sum.curvature += term.factor * (value.curvature + bias);
}

// Adds the gradients collected in gradients_ (one per row, zero where a row has no term between these frames) to Phi_q.
void Joint::add_gradients(ConstSpan q, std::size_t f, Span phi_q_values) {
  Attached& own = frames_[f];
  if (own.position.empty()) return;
  own.frame->project(q, own.motion, gradients_.data() + 6 * f * rows_.size(), static_cast<int>(rows_.size()),
                     own.projected.data());
  for (std::size_t e = 0; e < own.position.size(); ++e) phi_q_values[own.position[e]] += own.projected[e];
}

void Joint::constraints(double t, ConstSpan q, ConstSpan v, const ConstraintBuffers& out) {
  if (rows_.empty()) return;
  if (pair_) {
    rigid_constraints(t, q, v, out);
  } else {
    general_constraints(t, q, v, out);
  }
}

void Joint::rigid_constraints(double t, ConstSpan q, ConstSpan v, const ConstraintBuffers& out) {
  const auto first = static_cast<std::size_t>(placement().c);
  const bool rates = !out.gamma.empty();
  pair_->evaluate(q, v,
                  {out.phi.empty() ? nullptr : &out.phi[first], rates ? &out.gamma[first] : nullptr,
                   out.phi_q_values.empty() ? nullptr : &out.phi_q_values[phi_q_begin_]});
  for (std::size_t r = 0; r < offsets_.size(); ++r) {
    const JointRow* driven = driven_ && rows_[r].driven ? &rows_[r] : nullptr;
    if (!out.phi.empty()) out.phi[first + r] -= offsets_[r] + (driven ? driven->function.value(t) : 0.0);
    if (!out.nu.empty()) out.nu[first + r] = driven ? driven->function.rate(t) : 0.0;
    if (rates) out.gamma[first + r] = (driven ? driven->function.acceleration(t) : 0.0) - out.gamma[first + r];
  }
}

void Joint::general_constraints(double t, ConstSpan q, ConstSpan v, const ConstraintBuffers& out) {
  const bool rates = !out.gamma.empty(), gradients = !out.phi_q_values.empty();
  evaluate_frames(q, rates ? v : ConstSpan{});
  std::fill(gradients_.begin(), gradients_.end(), 0.0);
  RelativeValue value;
  for (std::size_t r = 0; r < rows_.size(); ++r) {
    JointRow& row = rows_[r];
    const std::size_t global = static_cast<std::size_t>(placement().c) + r;
    Sum sum{t, -offsets_[r], 0};
    for (std::size_t k = 0; k < row.terms.size(); ++k) {
      add_term(r, k, rates, value, sum);
      if (!gradients) continue;
      const JointRow::Term& term = row.terms[k];
      double* ga = gradients_.data() + 6 * (at(term.a) * rows_.size() + r);
      double* gb = gradients_.data() + 6 * (at(term.b) * rows_.size() + r);
      for (std::size_t i = 0; i < 6; ++i) {
        ga[i] += term.factor * value.c[i];
        gb[i] += term.factor * value.c[6 + i];
      }
    }
    double phi = sum.phi;
    if (row.measure_offset) {
      offsets_[r] += phi;  // of the sum alone, whatever it was before
      row.measure_offset = false;
      phi = 0;
    }
    if (row.driven) phi -= row.function.value(t);
    // A driven angle means the same angle plus any number of turns.
    if (row.terms.size() == 1 && row.terms[0].turns()) phi -= kTwoPi * std::round(phi / kTwoPi);
    if (!out.phi.empty()) out.phi[global] = row.of_velocity ? 0 : phi;
    if (!out.nu.empty()) out.nu[global] = row.driven ? row.function.rate(t) : 0.0;
    if (rates) out.gamma[global] = (row.driven ? row.function.acceleration(t) : 0.0) - sum.curvature;
  }
  if (!gradients) return;
  const Span own = out.phi_q_values.subspan(phi_q_begin_, phi_q_count_);
  std::fill(own.begin(), own.end(), 0.0);
  for (std::size_t f = 0; f < frames_.size(); ++f) add_gradients(q, f, out.phi_q_values);
}

// d(Phi_q^T lambda)/dq = J^T (sum lambda dc/dx) J + derivative of J^T at constant wrench.
void Joint::tangent(const StateView& s, const TangentWeights& weights, Span w_values) {
  if (weights.q == 0 || rows_.empty()) return;
  if (pair_) {
    pair_->add_stiffness(s.q, s.lambda.data() + placement().c, weights.q, w_values);
  } else {
    evaluate_frames(s.q, {});
    blocks_.add(s.q, {}, derivatives(s, weights.q), pool(), w_values);
  }
}

// At the motion in frames_.
FrameBlocks::Derivatives Joint::derivatives(const StateView& s, double weight) const {
  const auto size = static_cast<Eigen::Index>(6 * frames_.size());
  FrameBlocks::Derivatives sum;
  sum.k.setZero(size, size);
  sum.wrench.setZero(size);
  RelativeValue value;
  for (std::size_t r = 0; r < rows_.size(); ++r) {
    const double lambda = weight * s.lambda[static_cast<std::size_t>(placement().c) + r];
    if (lambda == 0) continue;
    for (const JointRow::Term& term : rows_[r].terms) {
      const FrameMotion &a = frames_[at(term.a)].motion, &b = frames_[at(term.b)].motion;
      evaluate(term, a, b, false, value);
      Mat12 k = Mat12::Zero();
      add_curvature(term, a, b, lambda * term.factor, k);
      for (const auto& [p, bp] : {std::pair{6 * term.a, 0}, std::pair{6 * term.b, 6}}) {
        sum.wrench.segment<6>(p) += lambda * term.factor * Eigen::Map<const Vec6>(value.c.data() + bp);
        for (const auto& [g, bg] : {std::pair{6 * term.a, 0}, std::pair{6 * term.b, 6}})
          sum.k.block<6, 6>(p, g) += k.block<6, 6>(bp, bg);
      }
    }
  }
  return sum;
}

void Joint::hold_here(double t, ConstSpan q) {
  for (std::size_t r = 0; r < rows_.size(); ++r) {
    JointRow& row = rows_[r];
    if (row.terms.size() > 1) {
      row.measure_offset = true;
    } else if (row.driven || row.terms.front().kind == Relative::distance) {
      offsets_[r] = coordinate(q, static_cast<int>(r)) - (row.driven ? row.function.value(t) : 0.0);
    }
  }
}

void Joint::save(std::vector<double>& out) const {
  for (std::size_t r = 0; r < rows_.size(); ++r) {
    out.push_back(offsets_[r]);
    out.push_back(rows_[r].measure_offset ? 1 : 0);
    for (const TurnCounter& turns : turns_[r]) turns.save(out);
  }
  if (spin_) spin_->save(out);
  if (memory_) memory_->save(out);
}

void Joint::restore(ConstSpan& in) {
  for (std::size_t r = 0; r < rows_.size(); ++r) {
    if (in.size() < 2) throw Error(StatusCode::invalid_input, "the restart file ends too early");
    offsets_[r] = in[0];
    rows_[r].measure_offset = in[1] != 0;
    in = in.subspan(2);
    for (TurnCounter& turns : turns_[r]) turns.restore(in);
  }
  if (spin_) spin_->restore(in);
  if (memory_) memory_->restore(in);
}

const PairCoordinate* Joint::motion(std::string_view value) const {
  for (const JointMotion& motion : motions_)
    if (motion.value == value) return &motion.coordinate;
  return nullptr;
}

FrameMotion Joint::frame_motion(ConstSpan q, ConstSpan v, int f) const {
  FrameMotion motion;
  frames_.at(at(f)).frame->motion(q, v, motion);
  return motion;
}

Wrench Joint::reaction(const StateView& s, int f) const {
  Vec6 sum = Vec6::Zero();
  RelativeValue value;
  for (std::size_t r = 0; r < rows_.size(); ++r) {
    const double lambda = s.lambda[static_cast<std::size_t>(placement().c) + r];
    for (const JointRow::Term& term : rows_[r].terms) {
      if (term.a != f && term.b != f) continue;
      const FrameMotion a = frame_motion(s.q, {}, term.a), b = frame_motion(s.q, {}, term.b);
      evaluate(term, a, b, false, value);
      sum -= lambda * term.factor * Eigen::Map<const Vec6>(value.c.data() + (term.b == f ? 6 : 0));
    }
  }
  return {sum.head<3>(), sum.tail<3>()};
}

double Joint::coordinate(ConstSpan q, int row) const {
  const JointRow::Term& term = rows_.at(at(row)).terms.at(0);
  RelativeValue value;
  evaluate(term, frame_motion(q, {}, term.a), frame_motion(q, {}, term.b), false, value);
  return value.value;
}

}  // namespace espalier::dynamics
