// What contact of solids writes to restart files.
#include <cmath>

#include "dynamics/contact/solid_contact.hpp"

namespace espalier::dynamics::contact {

void SolidContact::save(std::vector<double>& out) const {
  const auto append = [&](const FaceSpot& spot) {
    out.insert(out.end(), {static_cast<double>(spot.face), spot.xi[0], spot.xi[1]});
  };
  out.push_back(static_cast<double>(pattern_.size()));
  for (const auto& [a, b] : pattern_) out.insert(out.end(), {static_cast<double>(a), static_cast<double>(b)});
  out.push_back(points_stale_ ? 1 : 0);
  out.push_back(static_cast<double>(points_.size()));
  for (std::size_t k = 0; k < points_.size(); ++k) {
    const Memory& m = memory_[k];
    append(points_[k].spot);
    out.insert(out.end(),
               {points_[k].weight, static_cast<double>(points_[k].opposite), made_at_[k][0], made_at_[k][1]});
    out.insert(out.end(), {m.layer, m.touched ? 1.0 : 0.0});
    for (const Vec3* x : {&m.ends.on_first, &m.ends.on_second, &m.ends.arm, &m.hold.arm, &m.hold.tangent})
      out.insert(out.end(), x->data(), x->data() + 3);
    out.insert(out.end(), m.ends.turn.data(), m.ends.turn.data() + 9);
    append(m.anchor);
  }
  for (const auto* boxes : {&widened_first_, &widened_second_}) {
    out.push_back(static_cast<double>(boxes->size()));
    for (const Box& b : *boxes) {
      out.insert(out.end(), b.low.data(), b.low.data() + 3);
      out.insert(out.end(), b.high.data(), b.high.data() + 3);
    }
  }
}

void SolidContact::restore(ConstSpan& in) {
  const auto take = [&] {
    if (in.empty()) throw Error(StatusCode::invalid_input, "the saved numbers end within the contact '" + name() + "'");
    const double x = in.front();
    in = in.subspan(1);
    return x;
  };
  const auto whole = [&](double least, std::size_t below) {
    const double x = take();
    if (!(x >= least && x < static_cast<double>(below)) || x != std::floor(x))
      throw Error(StatusCode::invalid_input, "the saved numbers do not fit the contact '" + name() + "'");
    return static_cast<Index>(x);
  };
  const auto vector = [&] {
    Vec3 x;
    for (int i = 0; i < 3; ++i) x[i] = take();
    return x;
  };
  const std::size_t faces = first_.faces().size(), others = second_ ? second_->faces().size() : 0;
  const auto spot = [&](std::size_t count) {
    FaceSpot s;
    s.face = whole(-1, count);
    s.xi[0] = take();
    s.xi[1] = take();
    return s;
  };
  std::set<std::array<Index, 2>> pattern;
  for (Index left = whole(0, in.size() + 1); left > 0; --left) {
    const Index a = whole(0, faces);
    pattern.insert({a, whole(second_ ? 0 : -1, others)});
  }
  pattern_stale_ = pattern_stale_ || pattern != pattern_;
  pattern_ = std::move(pattern);
  points_stale_ = take() != 0;
  points_.resize(static_cast<std::size_t>(whole(0, in.size() + 1)));
  memory_.assign(points_.size(), {});
  made_at_.assign(points_.size(), {});
  for (std::size_t k = 0; k < points_.size(); ++k) {
    Memory& m = memory_[k];
    points_[k].spot = spot(faces);
    points_[k].weight = take();
    points_[k].opposite = whole(second_ && !first_.is_line() ? 0 : -1, others);
    made_at_[k] = {take(), take()};
    m.layer = take();
    m.touched = take() != 0;
    for (Vec3* x : {&m.ends.on_first, &m.ends.on_second, &m.ends.arm, &m.hold.arm, &m.hold.tangent}) *x = vector();
    for (int i = 0; i < 9; ++i) m.ends.turn.data()[i] = take();
    m.anchor = spot(others);
  }
  for (auto* boxes : {&widened_first_, &widened_second_}) {
    boxes->resize(static_cast<std::size_t>(whole(0, in.size() + 1)));
    for (Box& b : *boxes) {
      b.low = vector();
      b.high = vector();
    }
  }
}

}  // namespace espalier::dynamics::contact
