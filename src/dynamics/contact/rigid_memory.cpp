// What contact of rigid shapes writes to restart files.
#include <cmath>

#include "dynamics/contact/rigid_contact.hpp"

namespace espalier::dynamics::contact {

void RigidContact::save(std::vector<double>& out) const {
  const auto append = [&](const Vec3& x) { out.insert(out.end(), x.data(), x.data() + 3); };
  out.push_back(static_cast<double>(pattern_.size()));
  for (const auto& [a, b] : pattern_) out.insert(out.end(), {static_cast<double>(a), static_cast<double>(b)});
  out.push_back(static_cast<double>(memory_.size()));
  for (const Memory& m : memory_) {
    out.insert(out.end(), {static_cast<double>(m.pair[0]), static_cast<double>(m.pair[1])});
    out.insert(out.end(), {static_cast<double>(m.id >> 32U), static_cast<double>(m.id & 0xffffffffU), m.damping});
    append(m.normal);
    for (const Vec3* x : {&m.ends.on_first, &m.ends.on_second, &m.ends.arm}) append(*x);
    out.insert(out.end(), m.ends.turn.data(), m.ends.turn.data() + 9);
    if (law_.impulse) out.push_back(m.begin);
  }
  out.push_back(static_cast<double>(last_q_.size()));
  out.push_back(static_cast<double>(last_v_.size()));
  out.insert(out.end(), last_q_.begin(), last_q_.end());
  out.insert(out.end(), last_v_.begin(), last_v_.end());
  // The pairs that are near, and until when: a new search would see others, and the pattern would grow at other times.
  out.push_back(static_cast<double>(widened_.size()));
  for (const Box& b : widened_) {
    append(b.low);
    append(b.high);
  }
  out.push_back(static_cast<double>(pairs_.size()));
  for (const Pair& p : pairs_) out.insert(out.end(), {static_cast<double>(p[0]), static_cast<double>(p[1])});
  if (law_.impulse) out.insert(out.end(), {impulse_, impacts_});
}

void RigidContact::restore(ConstSpan& in) {
  found_active_ = false;
  moved_q_.clear();
  const auto take = [&] {
    if (in.empty()) throw Error(StatusCode::invalid_input, "the saved numbers end within the contact '" + name() + "'");
    const double x = in.front();
    in = in.subspan(1);
    return x;
  };
  const auto whole = [&](double below) {
    const double x = take();
    if (!(x >= 0 && x < below) || x != std::floor(x))
      throw Error(StatusCode::invalid_input, "the saved numbers do not fit the contact '" + name() + "'");
    return static_cast<std::size_t>(x);
  };
  const auto vector = [&] {
    Vec3 x;
    for (int k = 0; k < 3; ++k) x[k] = take();
    return x;
  };
  const auto numbers = [&](std::size_t count) {
    if (count > in.size()) (void)whole(0);
    std::vector<double> x(in.begin(), in.begin() + static_cast<std::ptrdiff_t>(count));
    in = in.subspan(count);
    return x;
  };
  const auto most = static_cast<double>(in.size() + 1);
  std::vector<std::array<Index, 2>> pattern(whole(most));
  for (auto& pair : pattern)
    for (Index& body : pair) body = static_cast<Index>(whole(static_cast<double>(bodies_.size())));
  pattern_stale_ = pattern_stale_ || pattern != pattern_;
  pattern_ = std::move(pattern);
  memory_.assign(whole(most), {});
  constexpr double kWord = 4294967296.0;
  for (Memory& m : memory_) {
    for (Index& surface : m.pair) surface = static_cast<Index>(whole(static_cast<double>(surfaces_.size())));
    const std::uint64_t high = whole(kWord);
    m.id = high << 32U | whole(kWord);
    m.damping = take();
    m.normal = vector();
    for (Vec3* x : {&m.ends.on_first, &m.ends.on_second, &m.ends.arm}) *x = vector();
    for (int k = 0; k < 9; ++k) m.ends.turn.data()[k] = take();
    if (law_.impulse) m.begin = take();
  }
  const std::size_t q = whole(most), v = whole(most);
  last_q_ = numbers(q);
  last_v_ = numbers(v);
  widened_.resize(whole(static_cast<double>(surfaces_.size()) + 1));
  if (!widened_.empty() && widened_.size() != surfaces_.size()) (void)whole(0);
  for (Box& b : widened_) {
    b.low = vector();
    b.high = vector();
  }
  pairs_.resize(whole(most));
  for (Pair& p : pairs_)
    for (Index& surface : p) surface = static_cast<Index>(whole(static_cast<double>(surfaces_.size())));
  if (!law_.impulse) return;
  impulse_ = take();
  impacts_ = take();
}

}  // namespace espalier::dynamics::contact
